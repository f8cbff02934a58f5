//! The sparse error model against its definitions: finite differences, the exponential, van Loan.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    reason = "a test fails by panicking"
)]

use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use reconstruct::error_model::{
    ATT, BA, BG, CONSIDERED, CORIOLIS, MOUNT_YAW, Nine, Noise, POS, SA, SG, STATES, VEL,
    continuous, predict_backward,
};
use reconstruct::frame::{Body, Nav, Rot, Vec3, exp_so3};
use reconstruct::matrix::{expm, van_loan};
use reconstruct::mechanize::{Earth, Nav9, StepView, forward};

const F_B: [f64; 3] = [-6.0, 3.0, -9.2];
const W_B: [f64; 3] = [0.2, -0.3, 1.4];

fn view(c_mid: Rot<Nav, Body>) -> StepView {
    let f_n = c_mid.apply(Vec3::from(Vector3::from(F_B)));
    StepView {
        c_mid,
        f_n,
        a_n: f_n,
    }
}

fn belief() -> Nine {
    // Any positive definite joint covariance with a diagonal considered block.
    let n = STATES + CONSIDERED;
    let a = DMatrix::from_fn(n, n, |i, j| {
        schema::num::real(i * 31 + j * 17 + 3).sin() * 0.1 + if i == j { 1.0 } else { 0.0 }
    });
    let mut p = &a * a.transpose();
    for i in STATES..n {
        for j in STATES..n {
            if i != j {
                p[(i, j)] = 0.0;
            }
        }
    }
    Nine {
        p_xx: SMatrix::from_fn(|i, j| p[(i, j)]),
        p_xc: SMatrix::from_fn(|i, j| p[(i, STATES + j)]),
        p_cc: SVector::from_fn(|i, _| p[(STATES + i, STATES + i)]),
    }
}

#[test]
fn sparse_step_meets_the_exponential_and_van_loan() {
    for h in [0.01, 0.05] {
        let c = Rot::<Nav, Body>::from_euler(0.3, -0.2, 2.1);
        let (f_b, w_b) = (
            Vec3::<Body>::from(Vector3::from(F_B)),
            Vec3::from(Vector3::from(W_B)),
        );
        let (f, b) = continuous(&c, &f_b, &w_b);
        // The augmented system: considered errors are constants that drive the states.
        let n = STATES + CONSIDERED;
        let mut big = DMatrix::zeros(n, n);
        big.view_mut((0, 0), (STATES, STATES)).copy_from(&f);
        big.view_mut((0, STATES), (STATES, CONSIDERED))
            .copy_from(&b);
        let step = expm(&(-&big * h)).unwrap();
        let noise = Noise {
            accel: 0.7,
            rate: 0.02,
        };
        let mut density = DMatrix::zeros(STATES, STATES);
        for i in 0..3 {
            density[(VEL + i, VEL + i)] = noise.accel;
            density[(ATT + i, ATT + i)] = noise.rate;
        }
        let dense_f = DMatrix::from_fn(STATES, STATES, |i, j| -f[(i, j)]);
        let (phi, q) = van_loan(&dense_f, &density, h).unwrap();
        let block = |m: &DMatrix<f64>| SMatrix::<f64, STATES, STATES>::from_fn(|i, j| m[(i, j)]);
        let gamma = SMatrix::<f64, STATES, CONSIDERED>::from_fn(|i, j| step[(i, STATES + j)]);
        assert!((block(&step) - block(&phi)).norm() < 1e-12);
        let mut dense = belief();
        dense.predict(&block(&phi), &gamma, &block(&q));
        let mut sparse = belief();
        predict_backward(&mut sparse, &view(c), &f_b, &w_b, h, &noise);
        assert!((sparse.p_xx - dense.p_xx).norm() < 1e-12 * dense.p_xx.norm());
        assert!((sparse.p_xc - dense.p_xc).norm() < 1e-12 * dense.p_xc.norm());
        assert_eq!(sparse.p_cc, dense.p_cc);
        assert!((sparse.p_xx - sparse.p_xx.transpose()).norm() < 1e-13);
    }
}

/// Every block of F and B against a finite difference of the mechanisation (errors are estimate minus truth).
#[test]
fn continuous_model_meets_finite_differences() {
    let earth = Earth::flat();
    let c = Rot::<Nav, Body>::from_euler(0.2, -0.3, 1.2);
    let (f_b, w_b) = (Vector3::from(F_B), Vector3::from(W_B));
    let truth = Nav9 {
        r_n: Vec3::zero(),
        v_n: Vec3::new(12.0, -7.0, 0.5),
        c_nb: c,
    };
    let dt = 1e-5;
    let after = forward(&truth, Vec3::from(f_b), Vec3::from(w_b), dt, &earth).0;
    let difference = |hat: &Nav9, now: &Nav9| -> SVector<f64, STATES> {
        let e = hat.c_nb.m * now.c_nb.m.transpose();
        let psi = Vector3::new(
            e[(1, 2)] - e[(2, 1)],
            e[(2, 0)] - e[(0, 2)],
            e[(0, 1)] - e[(1, 0)],
        ) * 0.5;
        let mut x = SVector::<f64, STATES>::zeros();
        x.fixed_rows_mut::<3>(POS).copy_from(&(hat.r_n - now.r_n).v);
        x.fixed_rows_mut::<3>(VEL).copy_from(&(hat.v_n - now.v_n).v);
        x.fixed_rows_mut::<3>(ATT).copy_from(&psi);
        x
    };
    let (f, b) = continuous(&c, &Vec3::from(f_b), &Vec3::from(w_b));
    let small = 1e-4;
    for s in 0..STATES {
        let mut x = SVector::<f64, STATES>::zeros();
        x[s] = small;
        let hat = Nav9 {
            r_n: truth.r_n + Vec3::new(x[0], x[1], x[2]),
            v_n: truth.v_n + Vec3::new(x[3], x[4], x[5]),
            c_nb: Rot::from_matrix(exp_so3(&-Vector3::new(x[6], x[7], x[8])) * truth.c_nb.m),
        };
        let hat = forward(&hat, Vec3::from(f_b), Vec3::from(w_b), dt, &earth).0;
        let found = (difference(&hat, &after) - difference_start(s, small)) / dt / small;
        let want = f.column(s);
        assert!((found - want).norm() < 5e-3, "state {s}: {found} {want}");
    }
    for (j, df, dw) in drives(&f_b, &w_b) {
        let hat = forward(
            &truth,
            Vec3::from(f_b + df * small),
            Vec3::from(w_b + dw * small),
            dt,
            &earth,
        )
        .0;
        let mut found = difference(&hat, &after) / dt / small;
        found.fixed_rows_mut::<3>(POS).fill(0.0);
        let want = b.column(j);
        assert!(
            (found - want).norm() < 5e-3,
            "considered {j}: {found} {want}"
        );
    }
    assert_eq!(b[(VEL, CORIOLIS)], 1.0);
    assert_eq!(b[(VEL + 1, CORIOLIS + 1)], 1.0);
}

fn difference_start(s: usize, small: f64) -> SVector<f64, STATES> {
    let mut x = SVector::<f64, STATES>::zeros();
    x[s] = small;
    x
}

/// Each considered error as an error of the specific force and of the rate.
fn drives(f: &Vector3<f64>, w: &Vector3<f64>) -> Vec<(usize, Vector3<f64>, Vector3<f64>)> {
    let zero = Vector3::zeros();
    let unit = |i: usize| Vector3::ith(i, 1.0);
    let mut all = vec![(MOUNT_YAW, Vector3::z().cross(f), Vector3::z().cross(w))];
    for i in 0..3 {
        all.push((BA + i, unit(i), zero));
        all.push((SA + i, unit(i) * f[i], zero));
        all.push((BG + i, zero, unit(i)));
        all.push((SG + i, zero, unit(i) * w[i]));
    }
    all
}
