use super::*;
use crate::frame::{Nav, Rot};
use crate::matrix::van_loan;
use nalgebra::DMatrix;
use schema::num::real;

fn sample() -> (StepView, Vec3<Body>, Vec3<Body>, Density) {
    let c_mid = Rot::<Nav, Body>::from_euler(0.1, -0.2, 0.7);
    let f_b = Vec3::new(-6.0, 2.0, -9.6);
    let view = StepView {
        c_mid,
        f_n: c_mid.apply(f_b),
        a_n: Vec3::zero(),
    };
    let density = Density {
        accel: Vector3::new(0.01, 0.02, 0.03),
        rate: Vector3::new(1e-4, 2e-4, 3e-4),
    };
    (view, f_b, Vec3::new(0.1, -0.3, 1.2), density)
}

/// Against the general exponential and van Loan's integral of the continuous model.
#[test]
fn step_and_noise_meet_van_loan() {
    let (view, f_b, w_b, density) = sample();
    let h = 0.05;
    let step = Transition::moving(&view, &f_b, &w_b, h, &density, &Matrix3::identity());
    let (f9, b) = crate::error_model::continuous(&view.c_mid, &f_b, &w_b);
    let mut f = DMatrix::zeros(DIM, DIM);
    f.view_mut((0, 0), (9, 9)).copy_from(&f9);
    // The considered errors of the nine-state model are, in this order, the states from BA on, but for the pitch.
    f.view_mut((0, BA), (9, 9)).copy_from(&b.columns(0, 9));
    f.view_mut((0, BG), (9, 6)).copy_from(&b.columns(9, 6));
    let c = view.c_mid.m;
    let pitched = |v: &Vector3<f64>| c * Vector3::y().cross(v);
    f.view_mut((VEL, MOUNT_PITCH), (3, 1))
        .copy_from(&pitched(&f_b.v));
    f.view_mut((ATT, MOUNT_PITCH), (3, 1))
        .copy_from(&-pitched(&w_b.v));
    let mut w = DMatrix::zeros(DIM, DIM);
    let spread = |d: &Vector3<f64>| c * Matrix3::from_diagonal(d) * c.transpose();
    w.view_mut((VEL, VEL), (3, 3))
        .copy_from(&spread(&density.accel));
    w.view_mut((ATT, ATT), (3, 3))
        .copy_from(&spread(&density.rate));
    let (phi, q) = van_loan(&-&f, &w, h).unwrap();
    for j in 0..DIM {
        let mut e = Row::zeros();
        e[j] = 1.0;
        let column = step.apply(&e);
        let row = step.apply_transposed(&e);
        for i in 0..DIM {
            assert!((column[i] - phi[(i, j)]).abs() < 1e-13, "{i} {j}");
            assert!((row[i] - phi[(j, i)]).abs() < 1e-13, "{i} {j} transposed");
        }
    }
    let top = q.view((0, 0), (9, 9));
    assert!((top - step.q).norm() < 1e-15 + 1e-12 * step.q.norm());
    let ahead = Transition::ahead(&view, &f_b, &w_b, h, &density, &Matrix3::identity());
    let (phi, q) = van_loan(&f, &w, h).unwrap();
    for j in 0..DIM {
        let mut e = Row::zeros();
        e[j] = 1.0;
        let column = ahead.apply(&e);
        for i in 0..DIM {
            assert!((column[i] - phi[(i, j)]).abs() < 1e-13, "{i} {j} ahead");
        }
    }
    let top = q.view((0, 0), (9, 9));
    assert!((top - ahead.q).norm() < 1e-15 + 1e-12 * ahead.q.norm());
}

#[test]
fn inverse_undoes_the_step() {
    let (view, f_b, w_b, density) = sample();
    let step = Transition::moving(&view, &f_b, &w_b, 0.05, &density, &Matrix3::identity())
        .with_slip(0.01, 1.0, 0.05);
    let x = Row::from_fn(|i, _| real(1 + 3 * i).sin());
    let step = step.with_shared(20.0, 0.05);
    assert!((step.inverse().apply(&step.apply(&x)) - x).norm() < 1e-14);
}

#[test]
fn congruences_meet_dense_products() {
    let (view, f_b, w_b, density) = sample();
    let step = Transition::moving(&view, &f_b, &w_b, 0.01, &density, &Matrix3::identity())
        .with_slip(0.01, 1.0, 0.01)
        .with_shared(2.0, 0.01)
        .with_jump([0.1, 0.2]);
    let root = Cov::from_fn(|i, j| real(1 + 3 * i + 7 * j).sin());
    let p = root * root.transpose();
    let mut phi = Cov::zeros();
    for j in 0..DIM {
        let mut e = Row::zeros();
        e[j] = 1.0;
        phi.set_column(j, &step.apply(&e));
    }
    let mut want = phi * p * phi.transpose();
    let mut view9 = want.fixed_view_mut::<9, 9>(0, 0);
    view9 += step.q;
    want[(SLIP, SLIP)] += step.q_slip;
    for axis in 0..3 {
        want[(PLACE + axis, PLACE + axis)] += 1.0 - step.shared.powi(2);
        want[(BA + axis, BA + axis)] += 0.1;
        want[(BG + axis, BG + axis)] += 0.2;
    }
    let mut found = p;
    step.predict(&mut found);
    assert!((found - want).norm() < 1e-11 * want.norm());
    let mut found = p;
    step.retract(&mut found);
    let want = phi.transpose() * p * phi;
    assert!((found - want).norm() < 1e-11 * want.norm());
}
