//! What must hold, figure by figure, and whether it does.
//!
//! The items are those of the acceptance list: 1 impact speed, 2 path and heading, 3 delta-V, 4 honest bounds, 5 real
//! drives, 6 faults. A bar is met or not by the best estimate; the interval beside it says how firmly.

use crate::validate::fault_runs::FaultTables;
use crate::validate::fixes::Window;
use crate::validate::honesty;
use crate::validate::measure::{Measure, When};
use crate::validate::statistics::{Estimate, quantile_estimate, sorted};
use crate::validate::tables::{Figures, Row, find};
use crate::validate::{ALL, ModelTables};

/// Least coverage at the 95 % level of any class, and of any fault, %.
const LEAST: f64 = 90.0;
/// One line of the list.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Item of the list.
    pub item: u8,
    /// What is measured.
    pub what: String,
    /// What was measured.
    pub measured: String,
    /// The bar.
    pub bar: String,
    /// Whether it is met by the best estimate; `None`: not measured.
    pub met: Option<bool>,
    /// Whether the whole 95 % interval is on the same side of the bar; `None`: not measured, or no single figure.
    pub firm: Option<bool>,
}

impl Bar {
    pub(super) fn most(
        item: u8,
        what: &str,
        measured: Option<Estimate>,
        unit: &str,
        most: f64,
    ) -> Self {
        Self {
            item,
            what: what.to_owned(),
            measured: measured.map_or("not measured".to_owned(), |e| shown(e, unit)),
            bar: format!("at most {most} {unit}"),
            met: measured.map(|e| e.value <= most),
            firm: measured.map(|e| (e.low <= most) == (e.high <= most)),
        }
    }

    /// What an item of the list is about.
    #[must_use]
    pub fn title(item: u8) -> &'static str {
        match item {
            1 => "impact speed",
            2 => "path and heading",
            3 => "delta-V at the centre of gravity",
            4 => "honest bounds",
            5 => "real drives",
            _ => "faults",
        }
    }

    /// `met`, `not met` or `not measured`.
    #[must_use]
    pub fn verdict(&self) -> &'static str {
        match self.met {
            Some(true) => "met",
            Some(false) => "not met",
            None => "not measured",
        }
    }

    /// The verdict, and whether the interval leaves it open.
    #[must_use]
    pub fn verdict_in_words(&self) -> String {
        let open = if self.firm == Some(false) {
            ", not firmly"
        } else {
            ""
        };
        format!("{}{open}", self.verdict())
    }
}

/// A figure with its interval, to three digits.
#[must_use]
pub fn shown(e: Estimate, unit: &str) -> String {
    let digits = if e.value.abs() >= 9.995 || e.high >= 9.995 {
        1
    } else if e.value.abs() >= 0.0995 {
        2
    } else {
        3
    };
    format!(
        "{:.digits$} {unit} ({:.digits$} to {:.digits$})",
        e.value, e.low, e.high
    )
}

/// The list for one model.
#[must_use]
pub fn bars(tables: &ModelTables, faults: &[FaultTables], windows: &[Window]) -> Vec<Bar> {
    let mut out = Vec::new();
    errors(&mut out, &tables.rows);
    honesty::bounds(&mut out, tables);
    drives(&mut out, tables.model, windows);
    for fault in faults.iter().filter(|f| f.model == tables.model) {
        out.extend(fault_bars(fault));
    }
    out
}

fn errors(out: &mut Vec<Bar>, rows: &[Row]) {
    let at = |measure, when| find(rows, ALL, measure, when);
    let quantile = |measure, when, i: usize| -> Option<Estimate> {
        at(measure, when).and_then(|f: &Figures| f.quantiles.get(i).copied())
    };
    let impact = When::Impact(0);
    let start = When::Back(0);
    let rms = |measure| at(measure, impact).map(|f| f.rms);
    let speed = |i| quantile(Measure::ImpactSpeed, impact, i);
    out.push(Bar::most(
        1,
        "impact speed, median error",
        speed(0),
        "m/s",
        0.08,
    ));
    out.push(Bar::most(
        1,
        "impact speed, 95th percentile",
        speed(2),
        "m/s",
        0.3,
    ));
    let path = |i| quantile(Measure::PositionShare, start, i);
    out.push(Bar::most(
        2,
        "position at -30 s, median",
        path(0),
        "% of distance",
        0.6,
    ));
    out.push(Bar::most(
        2,
        "position at -30 s, 90th percentile",
        path(1),
        "% of distance",
        1.3,
    ));
    out.push(Bar::most(
        2,
        "heading at -30 s, median",
        quantile(Measure::Heading, start, 0),
        "deg",
        0.5,
    ));
    for (what, measure, most) in [
        (
            "delta-V longitudinal, rms error / rms resultant",
            Measure::LongitudinalPooled,
            0.6,
        ),
        (
            "delta-V longitudinal, rms of each crash's error / resultant",
            Measure::LongitudinalShare,
            0.6,
        ),
        (
            "delta-V lateral, rms error / rms resultant",
            Measure::LateralPooled,
            1.0,
        ),
        (
            "delta-V lateral, rms of each crash's error / resultant",
            Measure::LateralShare,
            1.0,
        ),
    ] {
        out.push(Bar::most(3, what, rms(measure), "%", most));
    }
    out.push(Bar::most(
        3,
        "principal direction of force, 95th percentile",
        quantile(Measure::Pdof, impact, 2),
        "deg",
        1.5,
    ));
}

/// Whether a share's whole interval is on one side of a bar in percent.
fn firm(e: Estimate, bar: f64) -> bool {
    (100.0 * e.low >= bar) == (100.0 * e.high >= bar)
}

pub(super) fn least(item: u8, what: &str, worst: Option<(String, Estimate)>) -> Bar {
    Bar {
        item,
        what: what.to_owned(),
        measured: worst
            .as_ref()
            .map_or("not measured".to_owned(), |(name, e)| {
                format!("{} ({name})", shown(e.scaled(100.0), "%"))
            }),
        bar: format!("at least {LEAST} %"),
        met: worst.as_ref().map(|(_, e)| 100.0 * e.value >= LEAST),
        firm: worst.map(|(_, e)| firm(e, LEAST)),
    }
}

fn drives(out: &mut Vec<Bar>, model: &str, windows: &[Window]) {
    // A drive counts that ends at rest and was measured by somebody else's instrument.
    let real: Vec<&Window> = windows
        .iter()
        .filter(|w| w.model == model && w.rest_found && !w.same_frame)
        .collect();
    let shares: Vec<f64> = real.iter().filter_map(|w| w.start_percent).collect();
    out.push(Bar::most(
        5,
        "real drives, error at the window's start, median over the windows",
        quantile_estimate(&sorted(&shares), 0.5),
        "% of distance",
        0.5,
    ));
    let inside = real
        .iter()
        .filter_map(|w| Some((w, w.coverage?[2].estimate()?)))
        .min_by(|a, b| a.1.value.total_cmp(&b.1.value));
    out.push(Bar {
        item: 5,
        what: "real drives, fixes inside the 95 % ellipse of their instant, worst window"
            .to_owned(),
        measured: inside.as_ref().map_or("not measured".to_owned(), |(w, e)| {
            format!("{} ({})", shown(e.scaled(100.0), "%"), w.name)
        }),
        bar: "85 to 100 %".to_owned(),
        met: inside.as_ref().map(|(_, e)| e.value >= 0.85),
        firm: inside.map(|(_, e)| firm(e, 85.0)),
    });
}

/// The worst measure of a fault, and whether it was named.
fn fault_bars(fault: &FaultTables) -> [Bar; 2] {
    let worst = honesty::worst(&fault.rows);
    let named = fault.named.estimate();
    let mut inside = least(
        6,
        &format!(
            "{}: inside the 95 % bounds, worst measure",
            fault.fault.about()
        ),
        worst.map(|(m, w, e)| (format!("{}, {}", m.words(), w.name()), e)),
    );
    if fault.found.scored.hits < fault.found.scored.of {
        inside.measured = format!(
            "{}; {} of {} runs could be scored",
            inside.measured, fault.found.scored.hits, fault.found.scored.of
        );
    }
    let named = Bar {
        item: 6,
        what: format!("{}: named by the result", fault.fault.about()),
        measured: named.map_or("not measured".to_owned(), |e| {
            format!(
                "{}; without the fault {:.0} %",
                shown(e.scaled(100.0), "%"),
                100.0 * fault.named_without.value()
            )
        }),
        bar: format!("at least {LEAST} %"),
        met: named.map(|e| 100.0 * e.value >= LEAST),
        firm: named.map(|e| firm(e, LEAST)),
    };
    [inside, named]
}

#[cfg(test)]
mod tests {
    use super::{Bar, shown};
    use crate::validate::statistics::Estimate;

    #[test]
    fn a_bar_is_met_by_the_best_estimate_and_silent_without_one() {
        let e = |value| Estimate {
            value,
            low: 0.9 * value,
            high: 1.1 * value,
        };
        assert_eq!(
            Bar::most(1, "x", Some(e(0.08)), "m/s", 0.08).verdict(),
            "met"
        );
        assert_eq!(
            Bar::most(1, "x", Some(e(0.09)), "m/s", 0.08).verdict(),
            "not met"
        );
        assert_eq!(
            Bar::most(1, "x", None, "m/s", 0.08).verdict(),
            "not measured"
        );
        assert_eq!(
            Bar::most(1, "x", Some(e(0.079)), "m/s", 0.08).verdict_in_words(),
            "met, not firmly"
        );
        assert_eq!(
            Bar::most(1, "x", Some(e(0.07)), "m/s", 0.08).verdict_in_words(),
            "met"
        );
        assert_eq!(shown(e(0.05), "m"), "0.050 m (0.045 to 0.055)");
        assert_eq!(shown(e(95.0), "%"), "95.0 % (85.5 to 104.5)");
    }
}
