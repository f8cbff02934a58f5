//! Seeded crashes with known truth.
//!
//! A [`Scenario`] says everything: car, road, driver, impacts, sensors. [`Scenario::draw`] makes one from a
//! class and a seed; every field is public, so a test can make a single cause visible. [`simulate`] turns it
//! into motion, sensors and frames, in the order the data flows:
//!
//! 1. `driver`, `motion`: one smooth motion on a 2 kHz grid, from the approach to the rest.
//! 2. `rigid`: what an IMU at its place feels between the grid points. Integrating that gives the truth.
//! 3. [`truth`]: the states at the ends of the 10 ms bins, and the facts of the events.
//! 4. `sensors`: frames that are means over their period, with the errors of [`errors`].
//! 5. `samples`: 10 ms means without a bus, or `can`, `config`: log, DBC and configuration for the recorder.
//!
//! Time zero is the log's first frame, at a full second of UTC. Row `k` of the truth and sample `k` belong
//! together: the sample covers the 10 ms that end at the row's time.

mod can;
pub mod city;
mod class;
mod config;
mod draw;
mod driver;
pub mod errors;
mod files;
pub mod fixes;
mod motion;
pub mod nmea;
mod process;
mod pulse;
mod random;
mod rigid;
mod samples;
pub mod scenario;
mod sensors;
pub mod truth;
pub mod tumble;

use nalgebra::Vector3;
use schema::Sample;

pub use can::Frame;
pub use class::{Class, Grade};
pub use errors::{Errors, Sheet};
pub use pulse::Pulse;
pub use scenario::Scenario;
pub use sensors::{ImuFrame, WheelFrame};
pub use truth::{Facts, Truth, TruthRow};

/// Why a scenario could not be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulateError {
    /// No such class.
    #[error(
        "class: no class `{0}`, expected one of frontal, oblique, side, rear, double, lights, roof, stop, drive, still"
    )]
    UnknownClass(String),
    /// No such grade.
    #[error("grade: no grade `{0}`, expected tactical, consumer or perfect")]
    UnknownGrade(String),
    /// Not a rate the grid divides into.
    #[error(
        "IMU rate: {0} Hz, expected a divisor of 2000 from 100 to 1000 (100, 125, 200, 250, 400, 500, 1000)"
    )]
    ImuRate(usize),
    /// A quantity outside what can be simulated.
    #[error("scenario: {name} is {value}, expected {expected}")]
    Quantity {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// A file could not be written.
    #[error("{path}: {message}")]
    Write {
        /// Which.
        path: String,
        /// What the system said.
        message: String,
    },
    /// The car did not come to rest.
    #[error(
        "scenario: the car is not at rest after {seconds} s, expected a braking or an impact that ends the drive"
    )]
    NoRest {
        /// Longest simulated time, s.
        seconds: f64,
    },
}

/// A simulated crash.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// What was simulated.
    pub scenario: Scenario,
    /// What really happened.
    pub truth: Truth,
    /// Output of the IMU, one entry a period, lost frames included and marked.
    pub imu: Vec<ImuFrame>,
    /// Output of the wheel sensors.
    pub wheels: Vec<WheelFrame>,
    /// Frames on the bus, sorted by receive time.
    pub frames: Vec<Frame>,
}

/// Simulates one scenario: same scenario, same result to the last bit on one platform.
///
/// # Errors
/// [`SimulateError`] if a quantity is out of range or the car never comes to rest.
pub fn simulate(scenario: &Scenario) -> Result<Simulated, SimulateError> {
    scenario.check()?;
    let motion = motion::integrate(scenario)?;
    let car = &scenario.car;
    let foot = Vector3::new(car.cg[0], car.cg[1], 0.0);
    let rigid = rigid::at(&motion, Vector3::from(car.imu) - foot, scenario.gravity);
    let bins = motion.nodes.len().saturating_sub(2) / motion::STEPS_PER_BIN;
    let steps = bins * motion::STEPS_PER_BIN;
    let truth = truth::truth(
        scenario,
        &motion,
        &rigid,
        Vector3::from(car.cg) - foot,
        bins,
    );
    let imu = sensors::imu_frames(scenario, &rigid, steps);
    let wheels = sensors::wheel_frames(scenario, &motion, steps);
    let frames = can::frames(scenario, &imu, &wheels);
    Ok(Simulated {
        scenario: scenario.clone(),
        truth,
        imu,
        wheels,
        frames,
    })
}

impl Simulated {
    /// 10 ms means of what the sensors put out, wheel values in the bin in which the frame was sent;
    /// sample `k` belongs to truth row `k`. A single lost IMU frame is bridged from its neighbours, more
    /// leave the bin missing.
    #[must_use]
    pub fn samples(&self) -> Vec<Sample> {
        samples::samples(
            &self.imu,
            &self.wheels,
            self.truth.rows.len(),
            self.scenario.imu_hz,
        )
    }

    /// The frames as `candump -L` text.
    #[must_use]
    pub fn candump(&self) -> String {
        can::candump(&self.frames)
    }

    /// The DBC of the frames.
    #[must_use]
    pub fn dbc(&self) -> String {
        can::dbc()
    }

    /// The recorder's configuration (TOML), naming the DBC file `dbc`. It states the data sheet, never the
    /// drawn errors.
    #[must_use]
    pub fn config(&self, dbc: &str) -> String {
        config::config(&self.scenario, dbc)
    }

    /// The truth as CSV.
    #[must_use]
    pub fn truth_csv(&self) -> String {
        self.truth.csv()
    }

    /// `CLASS-SEED`, the name the files get.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}-{}", self.scenario.class, self.scenario.seed)
    }
}
