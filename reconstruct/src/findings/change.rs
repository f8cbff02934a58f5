//! A change of velocity between two moments of a pulse, and its sensitivities.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::error_model::{ATT, STATES, VEL};
use crate::findings::crash::Evidence;
use crate::frame::skew;
use crate::mechanize::Nav9;

/// The arm from the IMU to the point that delta-V is given for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arm {
    /// `cg`, or `imu` where the centre of gravity is not known.
    pub(crate) point: &'static str,
    /// Body axes, m.
    pub(crate) at: Vector3<f64>,
    /// One sigma, body axes, m.
    pub(crate) sd: Vector3<f64>,
}

impl Arm {
    pub(crate) fn of(evidence: &Evidence<'_>) -> Self {
        let vehicle = &evidence.epochs.header.vehicle;
        match vehicle.imu_position_m.zip(vehicle.cg_position_m) {
            Some((imu, cg)) => Self {
                point: "cg",
                at: Vector3::from(cg) - Vector3::from(imu),
                sd: Vector3::from_fn(|i, _| {
                    vehicle.imu_position_sd_m[i].hypot(vehicle.cg_position_sd_m[i])
                }),
            },
            None => Self {
                point: "imu",
                at: Vector3::zeros(),
                sd: Vector3::zeros(),
            },
        }
    }
}

/// A moment of the pulse: where the velocity is known, how fast the car turns, and how far it is to the instant meant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// State.
    pub(crate) nav: &'a Nav9,
    /// Rate, body axes, rad/s.
    pub(crate) rate: Vector3<f64>,
    /// Change of velocity from the state's instant to the one meant, body axes, m/s.
    pub(crate) step: Vector3<f64>,
}

/// A change of velocity between two moments, and what its errors need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    /// Attitude at the onset.
    pub(crate) c: Matrix3<f64>,
    /// From the body axes at the end to those at the onset.
    turned: Matrix3<f64>,
    /// Change, navigation axes, m/s.
    pub(crate) nav: Vector3<f64>,
    /// Change, body axes at the onset, m/s.
    pub(crate) body: Vector3<f64>,
    /// `C (w x arm + step)` at the onset and at the end.
    lever: [Vector3<f64>; 2],
    pub(crate) rate: [Vector3<f64>; 2],
    arm: Vector3<f64>,
}

impl Change {
    pub(crate) fn between(start: &Moment<'_>, end: &Moment<'_>, arm: &Vector3<f64>) -> Self {
        let lever = [start, end].map(|m| m.nav.c_nb.m * (m.rate.cross(arm) + m.step));
        let c = start.nav.c_nb.m;
        let nav = (end.nav.v_n.v + lever[1]) - (start.nav.v_n.v + lever[0]);
        Self {
            c,
            turned: c.transpose() * end.nav.c_nb.m,
            nav,
            body: c.transpose() * nav,
            lever,
            rate: [start.rate, end.rate],
            arm: *arm,
        }
    }

    /// Sensitivities (3 x 18) of the change in navigation axes and in body axes to the nine errors at the onset
    /// and the nine at the end. With `C_hat = (I - [psi x]) C`: `d(C u) = [C u x] psi` and
    /// `d(C' V) = C' (dV - [V x] psi)`.
    pub(crate) fn jacobians(&self) -> [SMatrix<f64, 3, { 2 * STATES }>; 2] {
        let mut nav = SMatrix::<f64, 3, { 2 * STATES }>::zeros();
        let identity = Matrix3::identity();
        nav.fixed_view_mut::<3, 3>(0, VEL).copy_from(&-identity);
        nav.fixed_view_mut::<3, 3>(0, STATES + VEL)
            .copy_from(&identity);
        nav.fixed_view_mut::<3, 3>(0, ATT)
            .copy_from(&-skew(&self.lever[0]));
        nav.fixed_view_mut::<3, 3>(0, STATES + ATT)
            .copy_from(&skew(&self.lever[1]));
        let mut body = nav;
        let mut block = body.fixed_view_mut::<3, 3>(0, ATT);
        block -= skew(&self.nav);
        [nav, self.c.transpose() * body]
    }

    /// Share of the arm's doubt and of the two rates' (variances, (rad/s)^2), body axes at the onset.
    pub(crate) fn lever_covariance(
        &self,
        arm_sd: &Vector3<f64>,
        rate: [Vector3<f64>; 2],
    ) -> Matrix3<f64> {
        let by_arm = self.turned * skew(&self.rate[1]) - skew(&self.rate[0]);
        let by_rate = [skew(&self.arm), self.turned * skew(&self.arm)];
        let square = |m: &Matrix3<f64>, variance: &Vector3<f64>| {
            m * Matrix3::from_diagonal(variance) * m.transpose()
        };
        square(&by_arm, &arm_sd.map(|x| x * x))
            + square(&by_rate[0], &rate[0])
            + square(&by_rate[1], &rate[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Nav, Rot, Vec3};
    use nalgebra::SVector;

    /// Normal numbers of a seed (splitmix64, Box and Muller).
    struct Draws(u64);

    impl Draws {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (schema::num::real_u64((z ^ (z >> 31)) >> 11) + 0.5) / 9_007_199_254_740_992.0
        }

        fn normal(&mut self) -> f64 {
            let radius = (-2.0 * self.unit().ln()).sqrt();
            radius * (std::f64::consts::TAU * self.unit()).cos()
        }
    }

    fn nav(v: [f64; 3], euler: [f64; 3]) -> Nav9 {
        Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::from(Vector3::from(v)),
            c_nb: Rot::from_euler(euler[0], euler[1], euler[2]),
        }
    }

    /// The estimate that has these errors: `C_hat = Exp(-psi) C`.
    fn wrong(truth: &Nav9, e: &[f64]) -> Nav9 {
        let at = |i: usize| Vec3::<Nav>::new(e[i], e[i + 1], e[i + 2]);
        Nav9 {
            r_n: truth.r_n + at(0),
            v_n: truth.v_n + at(VEL),
            c_nb: truth.c_nb.corrected(-at(ATT)),
        }
    }

    struct Setting {
        start: Nav9,
        end: Nav9,
        rate: [Vector3<f64>; 2],
        step: [Vector3<f64>; 2],
        arm: Vector3<f64>,
    }

    impl Setting {
        fn new() -> Self {
            Self {
                start: nav([14.0, -3.0, 0.2], [0.03, -0.02, 0.8]),
                end: nav([3.0, -6.0, 0.1], [0.06, 0.01, 1.0]),
                rate: [Vector3::new(0.1, -0.05, 0.3), Vector3::new(-0.4, 0.2, 3.4)],
                step: [
                    Vector3::new(-0.04, 0.01, 0.0),
                    Vector3::new(0.02, -0.03, 0.0),
                ],
                arm: Vector3::new(0.5, -0.2, -0.1),
            }
        }

        fn change(&self, e: &SVector<f64, 18>, arm: &Vector3<f64>) -> Change {
            let (start, end) = (
                wrong(&self.start, &e.as_slice()[..9]),
                wrong(&self.end, &e.as_slice()[9..]),
            );
            let moment = |nav, i: usize| Moment {
                nav,
                rate: self.rate[i],
                step: self.step[i],
            };
            Change::between(&moment(&start, 0), &moment(&end, 1), arm)
        }
    }

    #[test]
    fn jacobians_meet_finite_differences() {
        let s = Setting::new();
        let [nav, body] = s.change(&SVector::zeros(), &s.arm).jacobians();
        for i in 0..18 {
            let mut e = SVector::zeros();
            e[i] = 1e-5;
            let (up, down) = (s.change(&e, &s.arm), s.change(&-e, &s.arm));
            let by = |a: Vector3<f64>, b: Vector3<f64>| (a - b) / 2e-5;
            assert!((by(up.nav, down.nav) - nav.column(i)).norm() < 1e-8, "{i}");
            assert!(
                (by(up.body, down.body) - body.column(i)).norm() < 1e-8,
                "{i}"
            );
        }
        for i in 0..3 {
            let mut d = Vector3::zeros();
            d[i] = 1e-4;
            let zero = SVector::zeros();
            let moved =
                (s.change(&zero, &(s.arm + d)).body - s.change(&zero, &(s.arm - d)).body) / 2e-4;
            let found = s
                .change(&zero, &s.arm)
                .lever_covariance(&(d * 1e4), [Vector3::zeros(); 2]);
            assert!((found - moved * moved.transpose()).norm() < 1e-8);
        }
    }

    /// 20,000 draws of correlated errors of realistic size against the formula.
    #[test]
    fn the_joint_covariance_meets_a_monte_carlo() {
        let s = Setting::new();
        let mut draws = Draws(7);
        // The two sides share most of their error, as a smoother's do.
        let sd = |i: usize| match i % 9 {
            0..=2 => 0.5,
            3..=5 => 0.08,
            _ => 0.006,
        };
        let mut root = SMatrix::<f64, 18, 18>::zeros();
        for i in 0..18 {
            for j in 0..18 {
                let own = if i == j { 0.3 } else { 0.0 };
                let same = if i % 9 == j % 9 {
                    0.9
                } else {
                    0.15 * draws.normal()
                };
                root[(i, j)] = sd(i) * (own + if j < 9 { same } else { 0.0 });
            }
        }
        let covariance = root * root.transpose();
        let truth = s.change(&SVector::zeros(), &s.arm);
        let [nav, body] = truth.jacobians();
        let arm_sd = Vector3::new(0.05, 0.04, 0.03);
        let by_arm = truth.lever_covariance(&arm_sd, [Vector3::zeros(); 2]);
        let want_body = body * covariance * body.transpose() + by_arm;
        let want_nav = nav * covariance * nav.transpose() + truth.c * by_arm * truth.c.transpose();
        let (mut found_body, mut found_nav) = (Matrix3::zeros(), Matrix3::zeros());
        let n = 20_000_u32;
        for _ in 0..n {
            let white = SVector::<f64, 18>::from_fn(|_, _| draws.normal());
            let arm = s.arm + Vector3::from_fn(|i, _| arm_sd[i] * draws.normal());
            let got = s.change(&(root * white), &arm);
            let (a, b) = (got.body - truth.body, got.nav - truth.nav);
            found_body += a * a.transpose() / f64::from(n);
            found_nav += b * b.transpose() / f64::from(n);
        }
        for (found, want) in [(found_body, want_body), (found_nav, want_nav)] {
            assert!((found - want).norm() < 0.05 * want.norm(), "{found} {want}");
        }
    }
}
