//! What is measured, and where in a crash.

use crate::validate::score::BACK_S;

/// What is measured. Errors are estimate less truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Horizontal distance from the true place, m.
    Position,
    /// The same in percent of the metres driven from there to rest; only where at least 10 m were.
    PositionShare,
    /// Forward speed, m/s.
    Speed,
    /// Heading, degrees.
    Heading,
    /// Long half axis of the 95 % ellipse, m: no error, a width.
    Axis,
    /// Onset of the impact, ms.
    Onset,
    /// Forward speed at the onset found against that at the true one, m/s.
    ImpactSpeed,
    /// The same in percent of the true speed.
    ImpactSpeedShare,
    /// Heading at the onset, degrees.
    ImpactHeading,
    /// Delta-V at the centre of gravity, forward, m/s.
    Longitudinal,
    /// To the right, m/s.
    Lateral,
    /// Horizontal resultant, m/s.
    Resultant,
    /// Principal direction of force, degrees.
    Pdof,
    /// Forward error in percent of the root mean square of the group's true resultants: its rms is
    /// `rms(error) / rms(true resultant)`, as published studies of recorders pool them.
    LongitudinalPooled,
    /// Lateral error, pooled likewise.
    LateralPooled,
    /// Forward error in percent of the same crash's true resultant: its rms is the rms of the ratios.
    LongitudinalShare,
    /// Lateral error in percent of the same crash's true resultant.
    LateralShare,
    /// Forward error in percent of the root mean square of the group's true forward components.
    LongitudinalOwn,
}

impl Measure {
    /// Those of an instant.
    pub const MOMENT: [Self; 5] = [
        Self::Position,
        Self::PositionShare,
        Self::Speed,
        Self::Heading,
        Self::Axis,
    ];

    /// Those of an impact.
    pub const IMPACT: [Self; 13] = [
        Self::Onset,
        Self::ImpactSpeed,
        Self::ImpactSpeedShare,
        Self::ImpactHeading,
        Self::Longitudinal,
        Self::Lateral,
        Self::Resultant,
        Self::Pdof,
        Self::LongitudinalPooled,
        Self::LateralPooled,
        Self::LongitudinalShare,
        Self::LateralShare,
        Self::LongitudinalOwn,
    ];

    /// Name in tables and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::PositionShare => "position-share",
            Self::Speed => "speed",
            Self::Heading => "heading",
            Self::Axis => "ellipse-axis",
            Self::Onset => "onset",
            Self::ImpactSpeed => "impact-speed",
            Self::ImpactSpeedShare => "impact-speed-share",
            Self::ImpactHeading => "impact-heading",
            Self::Longitudinal => "delta-v-longitudinal",
            Self::Lateral => "delta-v-lateral",
            Self::Resultant => "delta-v-resultant",
            Self::Pdof => "pdof",
            Self::LongitudinalPooled => "delta-v-longitudinal-pooled",
            Self::LateralPooled => "delta-v-lateral-pooled",
            Self::LongitudinalShare => "delta-v-longitudinal-share",
            Self::LateralShare => "delta-v-lateral-share",
            Self::LongitudinalOwn => "delta-v-longitudinal-own",
        }
    }

    /// Name in a sentence.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::ImpactSpeed => "impact speed",
            Self::Longitudinal => "delta-V longitudinal",
            Self::Lateral => "delta-V lateral",
            Self::Resultant => "delta-V resultant",
            Self::Pdof => "direction of force",
            _ => self.name(),
        }
    }

    /// Unit of its figures.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Axis => "m",
            Self::Speed
            | Self::ImpactSpeed
            | Self::Longitudinal
            | Self::Lateral
            | Self::Resultant => "m/s",
            Self::Heading | Self::ImpactHeading | Self::Pdof => "deg",
            Self::Onset => "ms",
            _ => "%",
        }
    }
}

/// Where in the crash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// An instant: place in [`BACK_S`].
    Back(usize),
    /// An impact: 0 the first.
    Impact(usize),
}

impl When {
    /// `-30 s` to `0 s`; `impact 1`, `impact 2`.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Back(i) => match BACK_S.get(i) {
                Some(back) if *back > 0.0 => format!("-{back} s"),
                _ => "0 s".to_owned(),
            },
            Self::Impact(i) => format!("impact {}", i + 1),
        }
    }
}
