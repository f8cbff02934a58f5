//! Switches between what the source says in one place and in another, and what is right.

/// Which half of the source, where the text and the program of appendix 6.5 differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// The program, which made the figures.
    #[default]
    Program,
    /// The text, its equations and tables.
    Text,
}

/// Whether a slip is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// As published.
    #[default]
    Published,
    /// Put right.
    Corrected,
}

/// Independent switches. [`Variant::default`] is the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Variant {
    /// Measurement noise: table 4.9, or the program's pitch, yaw and rounding.
    pub measurement_noise: Source,
    /// Process noise: table 4.10, or the program's `q1` and rounding.
    pub process_noise: Source,
    /// Row 9 of phi: (3.3) prints it without its two terms in dt.
    pub transition: Source,
    /// Rows of `H1`: (3.6) prints 13, without the rates about y and z.
    pub gnss_rows: Source,
    /// Rotations: (2.1) to (2.3) print those of the axes, the program's are those of the vector.
    pub rotations: Source,
    /// Roll in body to geographic: (2.5) has it, the program sets it to 0.
    pub roll: Source,
    /// Earth rate in body axes: (2.7a) prints `C_b^e`, the program has its transpose.
    pub earth_rate: Source,
    /// Acceleration: (2.7f) turns the specific force by `C_b^e` and adds gravity in ECEF axes; the program adds gravity
    /// in body axes and turns the sum by the attitude after the step.
    pub acceleration: Source,
    /// Speed gate: the text keeps slow fixes and drops their course only, the program drops them.
    pub gate: Source,
    /// Sign of `q5 dt^3 / 3` in Q.
    pub noise_integral: Reading,
    /// Order of the two rotations that take gravity to body axes in the program.
    pub gravity_order: Reading,
    /// Velocity turned by both the rate and the centripetal acceleration.
    pub turn: Reading,
    /// Attitude after the step, first-order, which stretches the velocity.
    pub orthogonal: Reading,
    /// Velocity along the body's x axis, or its norm.
    pub speed: Reading,
    /// Inertial velocity as a measurement of the state it was made from, or as its prediction.
    pub inertial: Reading,
    /// Difference of measured and predicted yaw, unwrapped or within half a turn.
    pub course: Reading,
    /// Shape of the Earth: a sphere, or WGS 84.
    pub earth: Reading,
}

impl Variant {
    /// As in the program.
    #[must_use]
    pub fn program() -> Self {
        Self::default()
    }

    /// As in the text where it differs in substance from the program; its misprints are not kept.
    #[must_use]
    pub fn text() -> Self {
        Self {
            measurement_noise: Source::Text,
            process_noise: Source::Text,
            roll: Source::Text,
            acceleration: Source::Text,
            gate: Source::Text,
            ..Self::default()
        }
    }

    /// The text letter by letter, misprints kept. It is not a filter to be used: yaw does not follow the rate.
    #[must_use]
    pub fn printed() -> Self {
        Self {
            transition: Source::Text,
            gnss_rows: Source::Text,
            rotations: Source::Text,
            earth_rate: Source::Text,
            ..Self::text()
        }
    }

    /// The program's tuning with every slip that has a switch put right.
    #[must_use]
    pub fn corrected() -> Self {
        Self {
            roll: Source::Text,
            noise_integral: Reading::Corrected,
            gravity_order: Reading::Corrected,
            turn: Reading::Corrected,
            orthogonal: Reading::Corrected,
            speed: Reading::Corrected,
            inertial: Reading::Corrected,
            course: Reading::Corrected,
            earth: Reading::Corrected,
            ..Self::default()
        }
    }
}
