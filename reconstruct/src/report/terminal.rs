//! The result on one screen: at most 24 lines of 80 columns, plain ASCII.

use crate::findings::{Figure, Reconstruction};
use crate::report::case::{Case, Signature};
use crate::report::number::{self, KMH};

const WIDTH: usize = 79;
const LINES: usize = 24;

/// The screen; `files` are the paths to name at its end (pictures and page), `code` is the exit code to come.
#[must_use]
pub fn screen(r: &Reconstruction, case: &Case<'_>, files: &[String], code: u8) -> String {
    let mut head = vec![format!(
        "{}: {}, bounds at {} confidence",
        ascii(case.file),
        r.model,
        number::percent(r.confidence)
    )];
    if case.signature == Signature::Broken || !case.damage.is_empty() {
        head.push("SEAL BROKEN: made from what could still be read of a damaged file".to_owned());
    }
    head.push(String::new());
    let mut foot = vec![String::new()];
    foot.extend(files.iter().map(|f| ascii(f)));
    foot.push(exit_line(r, case, code));
    let mut body = Vec::new();
    findings(r, &mut body);
    let mut lines: Vec<String> = head.into_iter().chain(body).collect();
    let room = LINES.saturating_sub(lines.len() + foot.len());
    lines.extend(limits(r, room));
    lines.extend(foot);
    let mut out = String::new();
    for line in lines {
        // A path is never cut: it is there to be copied.
        out.push_str(if line.contains('/') {
            &line
        } else {
            clip(&line)
        });
        out.push('\n');
    }
    out
}

fn findings(r: &Reconstruction, out: &mut Vec<String>) {
    if let Some(impact) = r.impacts.first() {
        out.push(speed_line("Impact speed", &impact.speed_mps));
        out.extend(sources(r));
        let dv = &impact.delta_v;
        let name = if dv.lower_bound {
            "Delta-V min."
        } else {
            "Delta-V"
        };
        out.push(speed_line(name, &dv.resultant_mps));
        let (words, hour) = number::direction(dv.pdof_deg.value);
        let degrees = number::shown(&dv.pdof_deg, 1.0, 0);
        let bounds = degrees
            .bounds
            .map_or(String::new(), |(l, h)| format!(" ({l} to {h})"));
        out.push(item(
            "Force came",
            &format!("{words}, {hour} o'clock, {} deg{bounds}", degrees.value),
        ));
        if r.impacts.len() > 1 {
            let times: Vec<String> = r
                .impacts
                .iter()
                .skip(1)
                .map(|i| crate::export::fixed::fixed(i.t_s.value, 2))
                .collect();
            out.push(item(
                "More impacts",
                &format!("{} at t = {} s", r.impacts.len() - 1, times.join(", ")),
            ));
        }
    } else {
        out.push(item("Impact", "none found"));
        out.push(speed_line("Top speed", &r.top_speed_mps));
    }
    match &r.braking {
        Some(b) => {
            let mean = number::shown(&b.mean_mps2, 1.0, 2);
            let bounds = mean
                .bounds
                .map_or(String::new(), |(l, h)| format!(" ({l} to {h})"));
            let onset = number::shown(&b.onset_t_s, 1.0, 2).value;
            out.push(item(
                "Braking",
                &format!("from t = {onset} s, mean {} m/s2{bounds}", mean.value),
            ));
        }
        None => out.push(item("Braking", "none found")),
    }
    let distance = number::shown(&r.distance_m, 1.0, 1);
    let bounds = distance
        .bounds
        .map_or(String::new(), |(l, h)| format!("  between {l} and {h}"));
    let window = r
        .states
        .first()
        .zip(r.states.last())
        .map_or(0.0, |(a, b)| b.t_s - a.t_s);
    out.push(item(
        "Distance",
        &format!(
            "{} m{bounds}, in {} s",
            distance.value,
            crate::export::fixed::fixed(window, 1)
        ),
    ));
    rest(r, out);
}

/// The three largest sources of the impact speed's uncertainty.
fn sources(r: &Reconstruction) -> Option<String> {
    let budget = r
        .details
        .budgets
        .iter()
        .find(|b| b.figure == "impact speed")?;
    let parts: Vec<String> = budget
        .sources
        .iter()
        .take(3)
        .map(|(name, share)| format!("{name} {} %", crate::export::fixed::fixed(100.0 * share, 0)))
        .collect();
    Some(item("  unsure by", &parts.join(", ")))
}

fn rest(r: &Reconstruction, out: &mut Vec<String>) {
    out.push(item(
        "Rest",
        &match (r.rest.found, r.rest.t_s) {
            (true, Some(t)) => {
                let on = r
                    .details
                    .final_rest
                    .as_ref()
                    .map_or("wheels", |f| f.lies_on);
                let on = match on {
                    "wheels" | "unknown" => String::new(),
                    on => format!(", on its {on}"),
                };
                format!("at t = {} s{on}", crate::export::fixed::fixed(t, 1))
            }
            _ => "not reached: the record ends moving".to_owned(),
        },
    ));
    if let Some(over) = &r.details.rollover {
        let angle = number::shown(&over.angle_deg, 1.0, 0);
        let bounds = angle
            .bounds
            .map_or(String::new(), |(l, h)| format!(" ({l} to {h})"));
        out.push(item(
            "Roll-over",
            &format!(
                "{} quarter turns, {} deg{bounds}{}",
                over.quarter_turns,
                angle.value,
                if over.certain {
                    ""
                } else {
                    ", turns not certain"
                }
            ),
        ));
    }
    if let Some(gnss) = &r.gnss {
        out.push(item(
            "On the earth",
            &crate::report::fixes::line(gnss, r.confidence),
        ));
    }
    if let Some(placing) = &r.map {
        out.push(item(
            "On the map",
            &crate::report::map::line(placing, r.confidence),
        ));
    }
}

fn limits(r: &Reconstruction, room: usize) -> Vec<String> {
    if r.limits.is_empty() || room < 3 {
        return Vec::new();
    }
    let mut lines = vec![String::new(), "What limits this result:".to_owned()];
    for (i, limit) in r.limits.iter().enumerate() {
        let wrapped = wrap(&ascii(limit), WIDTH - 4);
        let last = i + 1 == r.limits.len();
        if lines.len() + wrapped.len() + usize::from(!last) > room {
            if lines.len() < room {
                lines.push(format!("  ({} more in the report)", r.limits.len() - i));
            }
            break;
        }
        lines.extend(
            wrapped
                .iter()
                .enumerate()
                .map(|(k, l)| format!("{}{l}", if k == 0 { "  - " } else { "    " })),
        );
    }
    lines
}

fn exit_line(r: &Reconstruction, case: &Case<'_>, code: u8) -> String {
    let mut reasons = Vec::new();
    if case.signature == Signature::Broken || !case.damage.is_empty() {
        reasons.push("broken seal");
    }
    if !case.record.completion.complete {
        reasons.push("incomplete record");
    }
    if r.gaps {
        reasons.push("gaps in the data");
    }
    if code == 0 {
        "exit 0: sound".to_owned()
    } else {
        format!("exit {code}: finished with {}", reasons.join(", "))
    }
}

fn item(name: &str, text: &str) -> String {
    format!("{name:<14}{text}")
}

fn speed_line(name: &str, f: &Figure) -> String {
    let kmh = number::shown(f, KMH, 1);
    let si = number::shown(f, 1.0, 2).value;
    match kmh.bounds {
        Some((low, high)) => item(
            name,
            &format!("{} km/h  between {low} and {high}  ({si} m/s)", kmh.value),
        ),
        None => item(
            name,
            &format!("{} km/h  no bounds from this model  ({si} m/s)", kmh.value),
        ),
    }
}

/// Printable ASCII only: a hostile name must not steer the terminal.
#[must_use]
pub fn ascii(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '\u{2212}' | '\u{2011}' => '-',
            '\u{b2}' => '2',
            c if c.is_ascii_graphic() || c == ' ' => c,
            _ => '?',
        })
        .collect()
}

fn clip(line: &str) -> &str {
    line.get(..WIDTH.min(line.len())).unwrap_or(line)
}

fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::screen;
    use crate::report::sample_case;

    #[test]
    fn fits_one_screen_and_holds_no_control_characters() {
        let (record, damage) = (sample_case::record(), vec!["block 3: lost".to_owned()]);
        let mut r = sample_case::reconstruction();
        for n in 0..9 {
            r.limits
                .push(format!("Limit {n}: {}", "many words about it ".repeat(9)));
        }
        let case = sample_case::case(&record, &damage);
        let mut hostile = case;
        hostile.file = "x\u{1b}[2J\u{7}.svb";
        let files: Vec<String> = ["out/path.svg", "out/motion.svg", "out/report.html"]
            .map(str::to_owned)
            .to_vec();
        for case in [case, hostile] {
            let text = screen(&r, &case, &files, 3);
            assert!(text.lines().count() <= 24, "{text}");
            assert!(text.lines().all(|l| l.len() < 80), "{text}");
            assert!(
                text.chars()
                    .all(|c| c == '\n' || c.is_ascii_graphic() || c == ' ')
            );
            assert!(text.contains("SEAL BROKEN") && text.contains("more in the report"));
        }
    }
}
