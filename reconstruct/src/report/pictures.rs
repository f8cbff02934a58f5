//! The pictures of one reconstruction, each drawn once for its file and the page.

use crate::export::ellipse::Polygon;
use crate::findings::Reconstruction;
use crate::report::motion::{self, Layout};
use crate::report::plan::{Plan, View};
use crate::report::svg;

/// Everything that is drawn.
#[derive(Clone, Debug)]
pub struct Pictures {
    plan: Plan,
    wide: String,
    narrow: String,
}

impl Pictures {
    /// Draws a reconstruction; `outline` is the funnel's.
    #[must_use]
    pub fn draw(r: &Reconstruction, outline: &[Polygon]) -> Self {
        Self {
            plan: Plan::draw(r, outline),
            wide: motion::picture(r, Layout::Wide, "mw"),
            narrow: motion::picture(r, Layout::Narrow, "mn"),
        }
    }

    /// The file `path.svg`.
    #[must_use]
    pub fn path_file(&self) -> String {
        self.plan.file()
    }

    /// The file `motion.svg`.
    #[must_use]
    pub fn motion_file(&self) -> String {
        svg::file(&self.wide)
    }

    /// One view of the path for the page.
    #[must_use]
    pub fn path(&self, view: View) -> String {
        self.plan.panel(view)
    }

    /// The motion for the page.
    #[must_use]
    pub fn motion(&self, layout: Layout) -> &str {
        match layout {
            Layout::Wide => &self.wide,
            Layout::Narrow => &self.narrow,
        }
    }
}
