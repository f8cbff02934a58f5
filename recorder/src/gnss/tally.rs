//! How often something arrives.

use schema::num;

/// How often something arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrivals {
    /// Key of a signal in `[gnss]`, or kind of a sentence.
    pub name: String,
    /// Times.
    pub count: u64,
    /// A second, from the first to the last; 0 where it came less than twice.
    pub rate_hz: f64,
}

/// Counts arrivals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    count: u64,
    first_ns: i64,
    last_ns: i64,
}

impl Tally {
    /// It came at a time, ns on any one clock.
    pub(super) fn arrive(&mut self, at_ns: i64) {
        if self.count == 0 {
            self.first_ns = at_ns;
        }
        self.last_ns = at_ns;
        self.count += 1;
    }

    pub(super) fn arrivals(&self, name: &str) -> Arrivals {
        let span_s = num::real_i64(self.last_ns.saturating_sub(self.first_ns)) / 1e9;
        Arrivals {
            name: name.to_owned(),
            count: self.count,
            rate_hz: if self.count > 1 && span_s > 0.0 {
                num::real_u64(self.count - 1) / span_s
            } else {
                0.0
            },
        }
    }
}
