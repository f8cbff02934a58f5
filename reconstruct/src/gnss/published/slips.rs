//! Where the source slips: what it says, what is right, what is done, what changes it.
//!
//! The copy at hand lacks appendix 6.3, so Q (6.1) is known from the program only; rows of zeros that a copy may have
//! dropped are not counted as slips.

/// One slip of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slip {
    /// Where in S00.
    pub place: &'static str,
    /// What it says there.
    pub says: &'static str,
    /// What is right.
    pub right: &'static str,
    /// What is done by default.
    pub ours: &'static str,
    /// The fields of [`super::Variant`] that change it; empty: none does.
    pub switch: &'static str,
}

const fn slip(
    place: &'static str,
    says: &'static str,
    right: &'static str,
    ours: &'static str,
    switch: &'static str,
) -> Slip {
    Slip {
        place,
        says,
        right,
        ours,
        switch,
    }
}

/// The slips, equations first.
pub const SLIPS: [Slip; 35] = [
    slip(
        "(2.1) to (2.3)",
        "rotations of the axes, yet (2.5) builds body to geographic of them",
        "rotations of the vector: with those printed a car that drives north and turns right goes west. The \
         tag's orientation in the program is (2.6) of its accelerometer, which only rotations of the vector \
         level",
        "as the program must have them",
        "rotations",
    ),
    slip(
        "(2.4)",
        "the matrix takes geographic to ECEF axes",
        "it takes ECEF to geographic axes; the other way is its transpose",
        "the transpose, as in the program",
        "",
    ),
    slip(
        "(2.5) and 6.5",
        "the text turns by roll, pitch and yaw; the program sets roll to 0 there, but takes roll out of \
         gravity",
        "roll in both",
        "as in the program",
        "roll",
    ),
    slip(
        "(2.6) and (3.4)",
        "roll and pitch of the accelerometers, for a car at rest, measured at every sample of a moving one",
        "an acceleration of 1 m/s^2 reads as 0.1 rad of pitch. With the program's noise pitch follows with \
         a time constant of 45 s and roll of 14 s, and long accelerations and turns are taken for slopes",
        "as published",
        "",
    ),
    slip(
        "(2.7a)",
        "the Earth's rate is taken to body axes by the matrix from body axes",
        "by its transpose, as in the program",
        "as in the program",
        "earth_rate",
    ),
    slip(
        "(2.7d)",
        "attitude over a step to first order",
        "the whole rotation: to first order a velocity grows by (w dt)^2 / 2 a step, 0.36 % a second at 0.6 \
         rad/s",
        "as published",
        "orthogonal",
    ),
    slip(
        "(2.7f) and 6.5",
        "the text turns the specific force by the attitude before the step and adds gravity in ECEF axes; \
         the program adds gravity in body axes and turns the sum by the attitude after it",
        "either, if roll is in both rotations",
        "as in the program",
        "acceleration",
    ),
    slip(
        "6.5, gravity",
        "gravity to body axes by pitch after roll",
        "by roll after pitch, the inverse of (2.5); 0.005 m/s^2 at 5 degrees of each",
        "as in the program",
        "gravity_order",
    ),
    slip(
        "(2.7g)",
        "the velocity is turned by the rate, then the acceleration, centripetal part and all, is added",
        "one of the two: both turn it twice in the step",
        "as published",
        "turn",
    ),
    slip(
        "(2.7g) and 6.5",
        "the velocity along x is the norm of the velocity",
        "its projection on x: a norm cannot pass zero, so that noise at a stand adds up to a speed and a \
         car never backs",
        "as published",
        "speed",
    ),
    slip(
        "(3.4) and (3.5)",
        "the velocity (2.7g), made of the state's own, is a measurement of it with (1 m/s)^2",
        "a prediction. As a measurement it tells of the sample's change only, of which the steady gain, \
         0.246, enters: of 1 m/s^2 the filter sees a quarter. That is enough for 4.6 to find that the accelerometers \
         cannot hold the speed. And a velocity that turns is averaged with its past: 10 m/s at 0.5 rad/s \
         read 8.9 after 18 s",
        "as published",
        "inertial",
    ),
    slip(
        "(3.2g) to (3.2i)",
        "roll, pitch and yaw change by the rates about x, y and z",
        "by Euler's kinematics; on a slope of 0.1 rad a quarter turn puts up to 0.16 rad into roll or pitch \
         unseen",
        "as published",
        "",
    ),
    slip(
        "(3.3)",
        "row 9 is a plain 1",
        "dt and -dt of the rate and the bias about z, as in (3.2i) and the program; without them yaw stands \
         still",
        "as in the program",
        "transition",
    ),
    slip(
        "(3.6) and 6.5",
        "H1 has 13 rows in the text and 14 in the program",
        "15, as z1 and R1: those of the rates about y and z, and about z, are missing",
        "15 rows",
        "gnss_rows",
    ),
    slip(
        "(3.7)",
        "H2 has 9 rows, one of yaw",
        "8, as z2, R2 and the program",
        "8 rows",
        "",
    ),
    slip(
        "(3.8)",
        "phi(t_k, eta) transposed on the right",
        "phi(t_k+1, eta) transposed, as on the left; else Q is not symmetric",
        "as on the left",
        "",
    ),
    slip(
        "6.5, Q",
        "the bias enters the variances of the angles as -q5 dt^3 / 3",
        "as +q5 dt^3 / 3. It is 2.7e-12 rad^2 beside q3 dt of 0.02: no figure of the source changes",
        "as published",
        "noise_integral",
    ),
    slip(
        "tables 4.9 and 4.10, 6.5",
        "roll, pitch and yaw measured with (100 rad)^2 each; q1 of (2.2 m)^2, q3 of yaw (3.16 rad)^2; rates \
         cut to three digits",
        "the program has 1e4, 1e5 and 1e10 rad^2, q1 of 5, q3 of 10, rates of 1.8e-4, 5.5e-4 and 2.9e-5",
        "as in the program",
        "measurement_noise, process_noise",
    ),
    slip(
        "table 4.10",
        "process noise in the units of variances",
        "by (3.8) and the program, variances per second",
        "per second",
        "",
    ),
    slip(
        "3.4 and 6.5",
        "the filter estimates the gyro biases itself",
        "that about z is seen through the course only; at a variance of 1e10 rad^2 that is nothing, and \
         yaw's own variance grows by 10 rad^2 a second",
        "as in the program",
        "measurement_noise",
    ),
    slip(
        "6.5, course",
        "the measured course is within 0 and a turn, yaw is not, and their difference is taken as it is",
        "the difference within half a turn. Harmless at 1e10 rad^2; at the (100 rad)^2 of table 4.9 each \
         fix after a crossing of north pulls yaw by tenths of a radian",
        "as published",
        "course",
    ),
    slip(
        "4.4 and 6.5",
        "the text leaves out the course below a speed, the program the whole fix below 3 m/s",
        "the course only: position and velocity are as good at a crawl",
        "as in the program",
        "gate",
    ),
    slip(
        "6.5, P",
        "14 initial variances for 15 states",
        "15; the third position is missing, of 3 m^2",
        "3 m^2",
        "",
    ),
    slip(
        "6.5, stop",
        "at a stop nothing is updated: P stays as it was, and a fix due in that step is lost",
        "zero velocity as a measurement, and P with it",
        "as published",
        "",
    ),
    slip(
        "3.5 and 4.3",
        "variances and their bounds in m/s^2 and, in table 4.4, rad/s; bounds of 0.016 and 0.008 for the \
         axes and 0.048 for their sum",
        "(m/s^2)^2 and (rad/s)^2; 0.048 is twice the sum of the two. A car that runs smoothly enough is \
         taken to stand",
        "0.048 (m/s^2)^2",
        "",
    ),
    slip(
        "3.5 and 6.5",
        "variance over 1.0 s",
        "51 samples, k - 50 to k, divided by 50",
        "51 samples",
        "",
    ),
    slip(
        "6.5, update",
        "an update where the number of the fix modulo N is 1, the first left out",
        "it counts fixes, not seconds, and N = 1 is never met",
        "N = 1 takes every fix",
        "",
    ),
    slip(
        "3.7 and 6.5",
        "tests start from the velocity of the receiver",
        "the program starts from that of the reference, pitch and yaw too",
        "what the caller hands in",
        "",
    ),
    slip(
        "6.5, start",
        "the initial rates are of the sample at the fix",
        "of the sample 62 before, as everywhere else",
        "as in the program",
        "",
    ),
    slip(
        "6.5, radius",
        "latitudes of the ellipsoid on a sphere of 6,371 km",
        "WGS 84: at 63.4 degrees its radii are 0.25 % (north) and 0.38 % (east) longer, so that fixes seem \
         too close together",
        "as in the program",
        "earth",
    ),
    slip(
        "6.1 and 6.5",
        "height is column 14, above the sea",
        "column 13, above the ellipsoid, where the Earth is one; on the sphere only differences count",
        "what the caller hands in",
        "",
    ),
    slip(
        "6.5, gyro",
        "negated, then levelled by Ry(0.438) Rx(0.018)",
        "by the accelerometer's own levelling and half turn it would be Ry(-0.438) Rx(0.018), 50 degrees \
         apart, and negating all three rates mirrors them. Which axes the gyro's chip has is not said",
        "as in the program",
        "",
    ),
    slip(
        "table 4.7 and 6.5",
        "acceleration scaled by 0.97396",
        "the mean of table 4.7, 10.102 m/s^2, gives 0.97227",
        "as in the program",
        "",
    ),
    slip(
        "5.2",
        "a bias of -0.00423 rad/s grows to -7.271 degrees per second in 30 s",
        "to -7.271 degrees",
        "not used",
        "",
    ),
    slip(
        "3.7 and 4.5",
        "Ilsvikøra from fix 480 in the text, 481 in the figure and the program",
        "481",
        "not used",
        "",
    ),
];

#[cfg(test)]
mod tests {
    use super::SLIPS;
    use crate::gnss::published::Variant;

    #[test]
    fn every_switch_exists_and_every_slip_is_told() {
        let fields = format!("{:?}", Variant::default());
        for slip in SLIPS {
            assert!(
                !slip.place.is_empty() && !slip.says.is_empty() && !slip.right.is_empty(),
                "{slip:?}"
            );
            for name in slip.switch.split(", ").filter(|name| !name.is_empty()) {
                assert!(fields.contains(&format!("{name}: ")), "{name}");
            }
        }
        for field in fields
            .split([' ', ':'])
            .filter(|word| word.starts_with(char::is_lowercase))
        {
            assert!(
                SLIPS.iter().any(|slip| slip.switch.contains(field)),
                "{field}"
            );
        }
    }
}
