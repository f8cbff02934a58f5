//! Numbers as a person reads them: rounded to their uncertainty, the bounds always outwards.

use schema::num;

use crate::export::fixed::fixed;
use crate::findings::Figure;

/// Factor from m/s to km/h.
pub const KMH: f64 = 3.6;

/// A figure as text in one unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Best estimate, rounded to two digits of the half width.
    pub value: String,
    /// Lower and upper bound, rounded outwards; `None` where there are none.
    pub bounds: Option<(String, String)>,
}

/// True if the bounds say something.
#[must_use]
pub fn bounded(f: &Figure) -> bool {
    f.low.is_finite() && f.high.is_finite()
}

/// Decimals that show two digits of `half`, at least `least` and at most `most`.
#[must_use]
pub fn decimals(half: f64, least: usize, most: usize) -> usize {
    if !half.is_finite() || half <= 0.0 {
        return most;
    }
    num::round_usize((1.0 - half.log10().floor()).max(0.0)).clamp(least, most)
}

/// A figure in another unit, `factor` of the unit it has; at most `most` decimals.
#[must_use]
pub fn shown(f: &Figure, factor: f64, most: usize) -> Shown {
    if !bounded(f) {
        return Shown {
            value: fixed(f.value * factor, most.min(1)),
            bounds: None,
        };
    }
    let (low, value, high) = (f.low * factor, f.value * factor, f.high * factor);
    let digits = decimals(0.5 * (high - low), 0, most);
    let unit = 10.0_f64.powi(i32::try_from(digits).unwrap_or(0));
    // The small allowance keeps 60.1 from becoming 60.0 through its binary remainder.
    let down = ((low * unit) + 1e-6).floor() / unit;
    let up = ((high * unit) - 1e-6).ceil() / unit;
    Shown {
        value: fixed(value, digits),
        bounds: Some((fixed(down, digits), fixed(up, digits))),
    }
}

/// A speed: `61.3 km/h (17.0 m/s)`.
#[must_use]
pub fn speed(f: &Figure) -> String {
    format!(
        "{} km/h ({} m/s)",
        shown(f, KMH, 1).value,
        shown(f, 1.0, 2).value
    )
}

/// Bounds of a speed: `between 60.1 and 62.5 km/h (16.7 and 17.4 m/s)`.
#[must_use]
pub fn speed_bounds(f: &Figure) -> Option<String> {
    let (low, high) = shown(f, KMH, 1).bounds?;
    let (low_si, high_si) = shown(f, 1.0, 2).bounds?;
    Some(format!(
        "between {low} and {high} km/h ({low_si} and {high_si} m/s)"
    ))
}

/// Bounds in one unit: `between 3.1 and 4.2 m`.
#[must_use]
pub fn bounds(f: &Figure, factor: f64, most: usize, unit: &str) -> Option<String> {
    shown(f, factor, most)
        .bounds
        .map(|(low, high)| format!("between {low} and {high} {unit}"))
}

/// A confidence as per cent: `95 %`, `99.7 %`.
#[must_use]
pub fn percent(share: f64) -> String {
    let text = fixed(share * 100.0, 2);
    format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
}

/// A whole number with thin groups of three: `4 000`.
#[must_use]
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

/// The direction a force came from, in words and on the clock's face; `pdof_deg` is 0 frontal, positive from
/// the right. The words go by sectors of their own: what is 40 degrees off is not *slightly* off.
#[must_use]
pub fn direction(pdof_deg: f64) -> (&'static str, u8) {
    let angle = (pdof_deg + 180.0).rem_euclid(360.0) - 180.0;
    let right = angle >= 0.0;
    let pick = |on_right, on_left| if right { on_right } else { on_left };
    let words = match angle.abs() {
        a if a <= 10.0 => "from straight ahead",
        a if a <= 30.0 => pick(
            "from the front, slightly right",
            "from the front, slightly left",
        ),
        a if a <= 70.0 => pick("from the front right", "from the front left"),
        a if a <= 110.0 => pick("from the right", "from the left"),
        a if a <= 150.0 => pick("from the rear right", "from the rear left"),
        a if a <= 170.0 => pick("from behind, slightly right", "from behind, slightly left"),
        a if a.is_finite() => "from straight behind",
        _ => "from where cannot be told",
    };
    let hour = num::round_usize((angle.rem_euclid(360.0) / 30.0).round()) % 12;
    (
        words,
        u8::try_from(hour).map_or(12, |h| if h == 0 { 12 } else { h }),
    )
}

#[cfg(test)]
mod tests {
    use super::{bounds, count, direction, percent, shown, speed, speed_bounds};
    use crate::findings::Figure;

    fn figure(value: f64, half: f64) -> Figure {
        Figure {
            value,
            sd: half / 1.96,
            low: value - half,
            high: value + half,
        }
    }

    #[test]
    fn rounded_to_the_uncertainty_and_outwards() {
        let v = figure(61.3 / 3.6, 1.2 / 3.6);
        assert_eq!(speed(&v), "61.3 km/h (17.03 m/s)");
        assert_eq!(
            speed_bounds(&v).unwrap(),
            "between 60.1 and 62.5 km/h (16.69 and 17.37 m/s)"
        );
        assert_eq!(shown(&figure(412.3, 14.0), 1.0, 1).value, "412");
        assert_eq!(
            bounds(&figure(412.3, 14.0), 1.0, 1, "m").unwrap(),
            "between 398 and 427 m"
        );
        let none = Figure {
            value: 3.0,
            sd: f64::INFINITY,
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
        };
        assert_eq!(shown(&none, 1.0, 2).bounds, None);
        assert_eq!(
            shown(&figure(5.0, 0.0), 1.0, 2).bounds,
            Some(("5.00".into(), "5.00".into()))
        );
    }

    #[test]
    fn words_and_counts() {
        assert_eq!(percent(0.95), "95 %");
        assert_eq!(percent(0.997), "99.7 %");
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!(count(100), "100");
        assert_eq!(direction(0.0), ("from straight ahead", 12));
        assert_eq!(direction(-42.0), ("from the front left", 11));
        assert_eq!(direction(-50.0), ("from the front left", 10));
        assert_eq!(direction(-14.0).1, 12);
        assert_eq!(direction(90.0).0, "from the right");
        assert_eq!(direction(-179.0).1, 6);
        assert_eq!(direction(359.0).1, 12);
    }
}
