//! What shakes a car and is no crash: sizes at the IMU on the floor of the cabin.
//!
//! Peaks are of the order that instrumented cars show: potholes 1 to 5 g and bottoming 5 to 9 g
//! vertical, speed bumps to 2 g, kerbs some g for 10 to 30 ms, doors 1 to 4 g at 20 to 60 Hz (misuse tests of air-bag
//! units: rough road, kerb, pothole, door slam, under-floor knock), parking knocks and trailer hitches below
//! 6 km/h. Where no figure is at hand the size is an assumption, chosen on the hard side. Each horizontal push of a
//! kerb is kept below 3.3 km/h: tyres and suspension give no more without a crash.

use rand_chacha::ChaCha8Rng;

use super::wave::{Shape, Wave, pick, push, sign, wave};

/// Wheelbase, m.
const BASE: f64 = 2.7;

/// What happens on a drive, with the mean count an hour of driving.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A pothole; one in ten bottoms out.
    Pothole,
    /// A speed bump at 20 to 50 km/h.
    Bump,
    /// A kerb struck or climbed.
    Kerb,
    /// A drop off a kerb.
    Drop,
    /// A cattle grid.
    Grid,
    /// A rail crossing.
    Rails,
    /// A gravel road: seconds of strong vibration.
    Gravel,
    /// A stone or a branch against the floor.
    Knock,
    /// A door of the standing car.
    Door,
    /// The boot or the bonnet of the standing car.
    Boot,
    /// A trailer coupled, or its jerk on the drive.
    Trailer,
    /// A parking knock of 2 to 5 km/h.
    Parking,
    /// A car wash.
    Wash,
    /// Lifted by a jack, let down.
    Jack,
    /// Winched onto a tow truck.
    Tow,
    /// Braking at 0.8 to 1.1 g with ABS.
    Braking,
    /// A lane change at 0.8 to 0.95 g.
    Swerve,
}

impl Kind {
    /// All.
    pub const ALL: [Self; 17] = [
        Self::Pothole,
        Self::Bump,
        Self::Kerb,
        Self::Drop,
        Self::Grid,
        Self::Rails,
        Self::Gravel,
        Self::Knock,
        Self::Door,
        Self::Boot,
        Self::Trailer,
        Self::Parking,
        Self::Wash,
        Self::Jack,
        Self::Tow,
        Self::Braking,
        Self::Swerve,
    ];

    /// Met at any moment of driving, an hour of it.
    pub const ON_THE_ROAD: [(Self, f64); 8] = [
        (Self::Pothole, 40.0),
        (Self::Bump, 20.0),
        (Self::Kerb, 10.0),
        (Self::Drop, 5.0),
        (Self::Grid, 4.0),
        (Self::Rails, 6.0),
        (Self::Gravel, 4.0),
        (Self::Knock, 6.0),
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pothole => "potholes, 1 to 9 g vertical",
            Self::Bump => "speed bumps at 20 to 50 km/h",
            Self::Kerb => "kerbs struck, 1 to 6 g lateral",
            Self::Drop => "drops off a kerb",
            Self::Grid => "cattle grids",
            Self::Rails => "rail crossings",
            Self::Gravel => "stretches of gravel",
            Self::Knock => "knocks against the floor, 3 to 12 g",
            Self::Door => "door slams, 1 to 4 g",
            Self::Boot => "boot and bonnet slams",
            Self::Trailer => "trailer hitches and jerks, 3 to 6 km/h",
            Self::Parking => "parking knocks, 2 to 5 km/h",
            Self::Wash => "car washes",
            Self::Jack => "lifts by a jack",
            Self::Tow => "winched onto a tow truck",
            Self::Braking => "brakings at 0.8 to 1.1 g with ABS",
            Self::Swerve => "lane changes at 0.8 to 0.95 g",
        }
    }
}

/// The waves of an event met at a speed (m/s). Braking, lane change, gravel, jack and tow truck move the car itself:
/// only their shocks are here.
pub fn waves(kind: Kind, speed: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let side = sign(r);
    match kind {
        Kind::Pothole => pothole(speed, side, r),
        Kind::Bump => bump(side, r),
        Kind::Kerb => kerb(side, r),
        Kind::Drop => drop(side, r),
        Kind::Grid => grid(speed, r),
        Kind::Rails => rails(speed, side, r),
        Kind::Knock => knock(r),
        Kind::Door => door(side, r),
        Kind::Boot => boot(r),
        Kind::Trailer => trailer(side, r),
        Kind::Parking => parking(side, r),
        Kind::Wash => wash(r),
        Kind::Jack => jack(r),
        Kind::Tow => tow(side, r),
        Kind::Braking => braking(r),
        Kind::Gravel | Kind::Swerve => Vec::new(),
    }
}

/// Down and up, each axle.
fn pothole(speed: f64, side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    let hard = pick(r, 0.0, 1.0) < 0.1;
    let up = if hard {
        pick(r, 5.0, 9.0)
    } else {
        pick(r, 1.0, 5.0)
    };
    let length = if hard {
        pick(r, 0.008, 0.015)
    } else {
        pick(r, 0.015, 0.04)
    };
    for from in axles(speed) {
        let back = pick(r, 0.2, 1.2);
        all.push(wave(
            from,
            [-back, 0.3 * side * back, -up],
            Shape::Arch(length),
        ));
        all.push(wave(
            from + length,
            [0.2, 0.0, 0.5 * up],
            Shape::Arch(1.5 * length),
        ));
        all.push(hop(from + length, 0.3 * up, r));
    }
    all
}

/// Up and down, each axle, with the nose.
fn bump(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    let speed = pick(r, 20.0, 50.0) / 3.6;
    let metres = pick(r, 0.4, 3.7);
    let length = metres / speed;
    let up = pick(r, 0.5, 1.3) * (speed / 8.3).clamp(0.7, 1.8);
    for from in axles(speed) {
        // By its height over half its length: a cushion of 0.4 m pushes back, a hump of 3.7 m hardly does.
        let back = pick(r, 0.2, 0.5) * 0.4 / metres;
        all.push(wave(
            from,
            [-back, 0.0, -up],
            Shape::UpDown(length.max(0.05)),
        ));
        // The nose goes up and down by some degrees.
        all.push(wave(
            from,
            [0.12 * up, 0.1 * side, 0.0],
            Shape::UpDown(2.0 * length.max(0.05)),
        ));
        all.push(hop(from + length, 0.3 * up, r));
    }
    all
}

/// Sideways and back, each axle.
fn kerb(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    for from in axles(pick(r, 5.0, 30.0) / 3.6) {
        let length = pick(r, 0.010, 0.030);
        // 6 g for 24 ms are 3.3 km/h.
        let most = 0.144 / length;
        let (x, y) = (pick(r, 0.5, 4.0).min(most), pick(r, 1.0, 6.0).min(most));
        all.push(wave(
            from,
            [-x, side * y, -pick(r, 1.0, 5.0)],
            Shape::Arch(length),
        ));
        all.push(wave(
            from,
            [0.3 * x, 0.4 * y, 1.0],
            Shape::Ring(pick(r, 25.0, 40.0), 0.1),
        ));
        all.push(hop(from + length, 1.0, r));
    }
    all
}

/// A fall and its end, each axle.
fn drop(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    for from in axles(pick(r, 3.0, 15.0) / 3.6) {
        let fall = pick(r, 0.05, 0.1);
        all.push(wave(from, [0.1, 0.2 * side, 0.5], Shape::Arch(fall)));
        all.push(wave(
            from + fall,
            [-0.3, side * pick(r, 0.5, 1.0), -pick(r, 2.0, 5.0)],
            Shape::Arch(0.03),
        ));
        all.push(hop(from + fall, 0.7, r));
    }
    all
}

/// Bar after bar.
fn grid(speed: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let time = 2.4 / speed.max(4.0) + BASE / speed.max(4.0);
    let hz = (speed / pick(r, 0.15, 0.2)).clamp(10.0, 120.0);
    vec![wave(
        0.0,
        [pick(r, 0.2, 0.6), 0.2, pick(r, 0.5, 2.0)],
        Shape::Train(hz, time),
    )]
}

/// Two rails, each axle.
fn rails(speed: f64, side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    let gauge = 1.435 / speed.max(4.0);
    for axle in axles(speed) {
        for rail in [0.0, gauge] {
            let up = pick(r, 0.8, 3.0);
            all.push(wave(
                axle + rail,
                [-0.25 * up, 0.15 * side * up, -up],
                Shape::Arch(0.02),
            ));
        }
        all.push(hop(axle + gauge, 0.6, r));
    }
    all
}

/// A stone against the floor.
fn knock(r: &mut ChaCha8Rng) -> Vec<Wave> {
    let size = [pick(r, -2.0, 2.0), pick(r, -2.0, 2.0), -pick(r, 3.0, 12.0)];
    vec![
        wave(0.0, size, Shape::Arch(pick(r, 0.001, 0.005))),
        wave(0.0, [0.5, 0.5, 2.0], Shape::Ring(pick(r, 60.0, 150.0), 0.1)),
    ]
}

/// A door falls shut.
fn door(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let size = pick(r, 1.0, 4.0);
    vec![
        wave(
            0.0,
            [0.3 * size, side * size, 0.5 * size],
            Shape::Ring(pick(r, 20.0, 60.0), pick(r, 0.1, 0.2)),
        ),
        wave(0.0, [0.0, 0.1 * side, 0.0], Shape::Ring(1.6, 0.3)),
    ]
}

/// The boot falls shut.
fn boot(r: &mut ChaCha8Rng) -> Vec<Wave> {
    let size = pick(r, 1.0, 3.0);
    vec![
        wave(
            0.0,
            [0.7 * size, 0.1, size],
            Shape::Ring(pick(r, 15.0, 50.0), pick(r, 0.1, 0.2)),
        ),
        wave(0.0, [0.05, 0.0, 0.1], Shape::Ring(1.6, 0.3)),
    ]
}

/// A push and the swing after it.
fn trailer(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    vec![
        push(
            0.0,
            [side * pick(r, 3.0, 6.0), pick(r, -0.5, 0.5)],
            pick(r, 0.08, 0.15),
        ),
        wave(
            0.1,
            [-side * pick(r, 0.1, 0.4), 0.0, 0.2],
            Shape::Ring(pick(r, 3.0, 10.0), 0.2),
        ),
    ]
}

/// A push and the body work ringing.
fn parking(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let (size, angle) = (pick(r, 2.0, 5.0), pick(r, -1.2, 1.2));
    vec![
        push(
            0.0,
            [-side * size * angle.cos(), size * angle.sin()],
            pick(r, 0.06, 0.12),
        ),
        wave(0.0, [0.5, 0.3, 0.3], Shape::Ring(pick(r, 20.0, 40.0), 0.1)),
    ]
}

/// Brushes, and the chain that pulls.
fn wash(r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    for from in (0..12).map(|k| 5.0 * f64::from(k)) {
        let size = [pick(r, 0.0, 0.1), pick(r, 0.05, 0.3), 0.1];
        all.push(wave(from, size, Shape::Train(pick(r, 2.0, 5.0), 5.0)));
    }
    all.push(wave(30.0, [0.2, 0.0, 0.0], Shape::UpDown(0.5)));
    all
}

/// Strokes of the jack and the drop.
fn jack(r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    for from in (0..10).map(f64::from) {
        all.push(wave(from, [0.03, 0.05, 0.1], Shape::UpDown(0.3)));
    }
    all.push(wave(
        25.0,
        [0.1, 0.2, -pick(r, 0.5, 2.0)],
        Shape::Arch(0.05),
    ));
    all
}

/// The winch.
fn tow(side: f64, r: &mut ChaCha8Rng) -> Vec<Wave> {
    let mut all = Vec::new();
    for from in (0..20).map(|k| 1.7 * f64::from(k)) {
        all.push(wave(
            from,
            [pick(r, 0.1, 0.4), 0.05 * side, 0.1],
            Shape::Ring(pick(r, 1.5, 4.0), 0.2),
        ));
    }
    all
}

/// The ripple of the ABS.
fn braking(r: &mut ChaCha8Rng) -> Vec<Wave> {
    let time = pick(r, 1.0, 3.0);
    let hz = pick(r, 8.0, 15.0);
    vec![wave(
        0.2,
        [pick(r, 0.05, 0.2), 0.03, 0.1],
        Shape::Train(hz, time),
    )]
}

/// When the two axles pass.
fn axles(speed: f64) -> [f64; 2] {
    [0.0, BASE / speed.max(1.4)]
}

/// Wheel hop after a shock, of so many g.
fn hop(from: f64, size: f64, r: &mut ChaCha8Rng) -> Wave {
    wave(
        from,
        [0.1 * size, 0.2 * size, size],
        Shape::Ring(pick(r, 10.0, 14.0), pick(r, 0.15, 0.25)),
    )
}
