//! Work over all cores; the results come in the order of the jobs, whatever the number of threads.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// Threads the machine offers, at least one.
#[must_use]
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// Does every job on `threads` threads; `progress` hears after each job how many are done.
///
/// Threads take the next job from one queue, so a slow one holds up nobody. The results are in the order of `jobs`.
pub fn run<J: Sync, R: Send>(
    jobs: &[J],
    threads: usize,
    work: impl Fn(&J) -> R + Sync,
    mut progress: impl FnMut(usize),
) -> Vec<R> {
    let mut slots: Vec<Option<R>> = jobs.iter().map(|_| None).collect();
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, jobs.len().max(1)) {
            let sender = sender.clone();
            let (next, work) = (&next, &work);
            scope.spawn(move || {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(job) = jobs.get(place) else { return };
                    if sender.send((place, work(job))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for (done, (place, result)) in receiver.iter().enumerate() {
            if let Some(slot) = slots.get_mut(place) {
                *slot = Some(result);
            }
            progress(done + 1);
        }
    });
    slots.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::run;

    #[test]
    fn results_keep_the_order_of_the_jobs() {
        let jobs: Vec<u64> = (0..200).collect();
        let slow = |job: &u64| {
            let mut x = *job;
            for _ in 0..(job % 7) * 1000 {
                x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            }
            (job * 2, x)
        };
        let mut heard = Vec::new();
        let many = run(&jobs, 8, slow, |done| heard.push(done));
        assert_eq!(many, run(&jobs, 1, slow, |_| ()));
        assert_eq!(heard, (1..=200).collect::<Vec<_>>());
        assert!(run(&[], 4, slow, |_| ()).is_empty());
    }
}
