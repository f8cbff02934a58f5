//! Signals become one sample per 10 ms.
//!
//! **IMU.** Each frame stands for one sensor period, the one that ends at its place on the de-jittered
//! [`crate::timeline::Timeline`] (sample and hold). The signal is integrated over each bin with exact overlaps, so the sum of
//! samples times 10 ms is the sum of frames times their periods. One lost frame (a gap of two periods) is
//! bridged by the mean of its neighbours, but in a pulse ([`schema::bridge`]): the bins it falls in are missing there.
//! Where more are lost nothing is put in their place: a bin of which less than half is covered is missing, another is
//! the mean over what is covered.
//! **Wheels.** The mean of the frames that arrived in the bin, else missing.
//! **Clipping** is counted on the sensor's own axes, frame by frame, in the bin of the frame's middle.
//!
//! A bin is closed when every IMU stream's line has passed it and 50 ms are over, or after 600 ms.

use schema::num;
use schema::sample::Sample;

use crate::axes::Mounting;
use crate::bins::{AXES, Bin, Bins, GROUPS, index_of, start_of};
use crate::imu_stream::{ImuStream, Next};
use crate::plan::{Plan, Role};

/// A bin stays open at least so long after its end, for frames of another bus that come late.
const PATIENCE_NS: i64 = 50_000_000;
/// A bin is closed so long after its end even if a stream hangs behind.
const LAG_NS: i64 = 600_000_000;
/// Part of a bin that a lost frame may cover and leave it as it is, ns: the line of a jittering sensor is not exact.
const SLIVER: f64 = 5e5;
/// A frame's specific force at and above this is more than driving: gravity and 1 g beside it, m/s^2.
const SHARP: f64 = 13.8;

/// Frames at the sensor's limit in one bin, on body axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClipCount {
    /// 0 to 2 acceleration, 3 to 5 rate, body axes.
    pub axis: u8,
    /// -1 or +1, along the body axis.
    pub sign: i8,
    /// Clipped frames.
    pub clipped: u16,
    /// All frames.
    pub frames: u16,
}

/// A closed bin.
#[derive(Clone, Debug)]
pub struct Closed {
    /// Its index.
    pub index: u64,
    /// Its sample, body axes.
    pub sample: Sample,
    /// Frames of each group.
    pub frames: [u16; GROUPS],
    /// Lost frames: accel, rate.
    pub lost: [u16; 2],
    /// Clipping, the first [`ClipCount`]s that are `Some`.
    pub clips: [Option<ClipCount>; AXES],
}

/// A frame with a large acceleration, before averaging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// End of the frame's period on the de-jittered line, monotonic ns.
    pub time_ns: i64,
    /// Magnitude, m/s^2.
    pub value: f64,
    /// Body axis with the largest part: 0, 1, 2.
    pub axis: usize,
}

/// What comes out of the sampler.
#[derive(Clone, Debug)]
pub enum Output {
    /// A frame reached the peak threshold.
    Peak(Peak),
    /// A bin was closed.
    Bin(Closed),
}

/// The sampler.
#[derive(Clone, Debug)]
pub struct Sampler {
    streams: Vec<ImuStream>,
    bins: Bins,
    mounting: Mounting,
    /// Latest value of each acceleration axis and its time, for sensors that send them in several messages.
    latest: [(f64, f64); 3],
    peak_threshold: f64,
    largest: f64,
    /// Time of the last frame that was more than driving.
    sharp_ns: Option<i64>,
    started: bool,
    late: u64,
    unplaced: u64,
}

impl Sampler {
    /// A sampler for the plan; frames of at least `peak_threshold` (m/s^2) are given out.
    #[must_use]
    pub fn new(plan: &Plan, mounting: Mounting, peak_threshold: Option<f64>) -> Self {
        let mut streams =
            vec![ImuStream::new(0, [f64::INFINITY; AXES], [false; AXES]); plan.imu_streams];
        for stream in plan.messages.iter().flat_map(|message| &message.streams) {
            if let Role::Imu { number, channels } = &stream.role
                && let Some(slot) = streams.get_mut(*number)
            {
                let mut limits = [f64::INFINITY; AXES];
                let mut carries = [false; AXES];
                for channel in channels {
                    if let (Some(limit), Some(carried)) =
                        (limits.get_mut(channel.axis), carries.get_mut(channel.axis))
                    {
                        *limit = channel.limit;
                        *carried = true;
                    }
                }
                *slot = ImuStream::new(
                    stream.counter.map_or(0, |bits| bits.size()),
                    limits,
                    carries,
                );
            }
        }
        Self {
            streams,
            bins: Bins::default(),
            mounting,
            latest: [(f64::NAN, f64::NEG_INFINITY); 3],
            peak_threshold: peak_threshold.unwrap_or(f64::INFINITY),
            largest: 0.0,
            sharp_ns: None,
            started: false,
            late: 0,
            unplaced: 0,
        }
    }

    /// The IMU's streams.
    #[must_use]
    pub fn streams(&self) -> &[ImuStream] {
        &self.streams
    }

    /// Frames that came after their bin was closed.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Frames that could not be given a period (single ones).
    #[must_use]
    pub fn unplaced(&self) -> u64 {
        self.unplaced
    }

    /// Largest acceleration of any frame so far, m/s^2.
    #[must_use]
    pub fn largest_peak(&self) -> f64 {
        self.largest
    }

    /// Time of the last frame with more than 1 g beside gravity, monotonic ns: known long before any trigger.
    #[must_use]
    pub fn sharp_ns(&self) -> Option<i64> {
        self.sharp_ns
    }

    /// Index of the first bin that is not closed.
    #[must_use]
    pub fn next_index(&self) -> u64 {
        self.bins.base()
    }

    /// Begins (or begins anew) at a time: no line, no open bin. Bins before the first frame are not given out.
    pub fn begin(&mut self, time_ns: i64) {
        // A frame stands for the period before it: leave room for a slow sensor's.
        self.bins
            .begin(index_of(time_ns.saturating_sub(10 * PATIENCE_NS)).max(self.bins.base()));
        self.started = false;
        for stream in &mut self.streams {
            stream.restart(None);
        }
    }

    /// An IMU frame: the values its channels carry (NaN: none).
    pub fn imu(
        &mut self,
        number: usize,
        time_ns: i64,
        counter: Option<u32>,
        values: [f64; AXES],
        out: &mut Vec<Output>,
    ) {
        if let Some(stream) = self.streams.get_mut(number) {
            stream.push(time_ns, counter, values);
        }
        self.pump(number, time_ns, false, out);
    }

    /// A wheel frame, m/s.
    pub fn wheel(&mut self, side: usize, time_ns: i64, speed: f64) {
        if self.bins.wheel(side, speed, time_ns) {
            self.count(2 + side, time_ns);
        } else {
            self.late += 1;
        }
    }

    /// Time goes on to `now_ns`: places frames that waited long enough and closes bins.
    pub fn advance(&mut self, now_ns: i64, out: &mut Vec<Output>) {
        for number in 0..self.streams.len() {
            if self
                .streams
                .get(number)
                .is_some_and(|stream| stream.is_overdue(now_ns))
            {
                self.pump(number, now_ns, false, out);
            }
        }
        if now_ns - PATIENCE_NS < start_of(self.bins.base() + 1) {
            return;
        }
        let behind = self
            .streams
            .iter()
            .filter_map(|stream| stream.behind(now_ns - LAG_NS))
            .min()
            .unwrap_or(i64::MAX);
        let until = behind.max(now_ns - LAG_NS).min(now_ns - PATIENCE_NS);
        self.close(until, out);
    }

    /// Places every waiting frame and closes every bin that is full: the end, or a seam in time.
    pub fn flush(&mut self, now_ns: i64, out: &mut Vec<Output>) {
        for number in 0..self.streams.len() {
            self.pump(number, now_ns, true, out);
        }
        // The last frames' periods end the recording, not their receive times; unless the IMU fell silent before.
        let tiled = self.streams.iter().filter_map(ImuStream::tiled_ns).max();
        let reach = tiled
            .filter(|tiled| (now_ns - tiled).abs() < LAG_NS / 4)
            .unwrap_or(now_ns);
        self.close(reach, out);
    }

    /// After a flush: time goes on at `until_ns` (the end of the bin that marks the seam).
    pub fn seam(&mut self, until_ns: i64, out: &mut Vec<Output>) {
        for stream in &mut self.streams {
            stream.restart(Some(until_ns));
        }
        self.close(until_ns, out);
    }

    fn close(&mut self, until_ns: i64, out: &mut Vec<Output>) {
        while start_of(self.bins.base() + 1) <= until_ns {
            let (index, bin) = self.bins.close();
            let closed = self.closed(index, &bin);
            self.started |= closed.sample != Sample::default();
            if self.started {
                out.push(Output::Bin(closed));
            }
        }
    }

    fn closed(&self, index: u64, bin: &Bin) -> Closed {
        let sample = Sample {
            wheels: [bin.wheel(0), bin.wheel(1)],
            accel: self.mounting.apply([bin.mean(0), bin.mean(1), bin.mean(2)]),
            rate: self.mounting.apply([bin.mean(3), bin.mean(4), bin.mean(5)]),
        };
        let mut clips = [None; AXES];
        let counts = bin.clipped.iter().zip(&bin.axis_frames).enumerate();
        for ((sensor, ([down, up], frames)), slot) in counts.zip(&mut clips) {
            if *down == 0 && *up == 0 {
                continue;
            }
            let (axis, same) = self.mounting.nearest(sensor % 3);
            // Both ends within one bin: the sign of the larger count; the count is of both.
            let upwards = (up >= down) == same;
            *slot = Some(ClipCount {
                axis: u8::try_from(axis + sensor / 3 * 3).unwrap_or(0),
                sign: if upwards { 1 } else { -1 },
                clipped: up.saturating_add(*down),
                frames: *frames,
            });
        }
        Closed {
            index,
            sample,
            frames: bin.frames,
            lost: bin.lost,
            clips,
        }
    }

    fn count(&mut self, group: usize, time_ns: i64) {
        if let Some(frames) = self
            .bins
            .at(index_of(time_ns))
            .and_then(|bin| bin.frames.get_mut(group))
        {
            *frames = frames.saturating_add(1);
        }
    }

    /// Places the waiting frames of a stream as far as they can be.
    fn pump(&mut self, number: usize, now_ns: i64, force: bool, out: &mut Vec<Output>) {
        let Some(stream) = self.streams.get_mut(number) else {
            return;
        };
        loop {
            let placed = match stream.next(now_ns, force) {
                Next::Wait => return,
                Next::Unplaced => {
                    self.unplaced += 1;
                    continue;
                }
                Next::Placed(placed) => placed,
            };
            if let Some((from, bridge)) = placed.bridge {
                self.bins.spread(&bridge, from, placed.start);
            }
            if let Some(from) = placed.torn {
                self.bins
                    .tear(stream.carries(), from + SLIVER, placed.start - SLIVER);
            }
            if !self.bins.spread(&placed.values, placed.start, placed.end) {
                self.late += 1;
                continue;
            }
            let middle = index_of(num::floor_i64(f64::midpoint(placed.start, placed.end)));
            if let Some(bin) = self.bins.at(middle) {
                let lost = u16::try_from(placed.lost).unwrap_or(u16::MAX);
                for (group, (axes, slot)) in
                    [(0..3), (3..6)].into_iter().zip(&mut bin.lost).enumerate()
                {
                    if stream.leads(group) {
                        *slot = slot.saturating_add(lost);
                        if let Some(frames) = bin.frames.get_mut(group) {
                            *frames = frames.saturating_add(1);
                        }
                    }
                    for axis in axes {
                        clip(
                            &mut bin.axis_frames,
                            &mut bin.clipped,
                            axis,
                            placed.values,
                            stream.limit(axis),
                        );
                    }
                }
            }
            if stream.leads_any_accel() {
                for (latest, value) in self.latest.iter_mut().zip(placed.values) {
                    if !value.is_nan() {
                        *latest = (value, placed.end);
                    }
                }
                if let Some(peak) = peak(&self.latest, placed.end, &self.mounting) {
                    self.largest = self.largest.max(peak.value);
                    if peak.value >= SHARP {
                        self.sharp_ns = Some(peak.time_ns);
                    }
                    if peak.value >= self.peak_threshold {
                        out.push(Output::Peak(peak));
                    }
                }
            }
        }
    }
}

fn clip(
    frames: &mut [u16; AXES],
    clipped: &mut [[u16; 2]; AXES],
    axis: usize,
    values: [f64; AXES],
    limit: f64,
) {
    let (Some(value), Some(frames), Some([down, up])) = (
        values.get(axis),
        frames.get_mut(axis),
        clipped.get_mut(axis),
    ) else {
        return;
    };
    if value.is_nan() {
        return;
    }
    *frames = frames.saturating_add(1);
    if *value >= limit {
        *up = up.saturating_add(1);
    } else if *value <= -limit {
        *down = down.saturating_add(1);
    }
}

/// Magnitude of the latest acceleration, if all three axes are fresh.
fn peak(latest: &[(f64, f64); 3], now: f64, mounting: &Mounting) -> Option<Peak> {
    if latest
        .iter()
        .any(|(value, time)| value.is_nan() || now - time > 5e7)
    {
        return None;
    }
    let [(x, _), (y, _), (z, _)] = latest;
    let value = (x * x + y * y + z * z).sqrt();
    let largest = [x, y, z]
        .into_iter()
        .enumerate()
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let axis = mounting.nearest(largest.map_or(0, |(axis, _)| axis)).0;
    Some(Peak {
        time_ns: num::round_i64(now),
        value,
        axis,
    })
}
