//! The same work on many inputs, on every core, results in the order of the inputs.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// `work` on every input; the first error in the order of the inputs, whichever came first in time.
pub(super) fn map<I: Sync, T: Send, E: Send>(
    inputs: &[I],
    work: impl Fn(&I) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<T, E>)>> = Mutex::new(Vec::with_capacity(inputs.len()));
    std::thread::scope(|scope| {
        for _ in 0..cores.min(inputs.len()) {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(input) = inputs.get(at) else { return };
                    let result = work(input);
                    done.lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push((at, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::map;

    #[test]
    fn order_is_kept_and_the_first_error_wins() {
        let inputs: Vec<u32> = (0..100).collect();
        let doubled: Result<Vec<u32>, u32> = map(&inputs, |x| Ok(2 * x));
        assert_eq!(doubled.unwrap()[99], 198);
        let failed: Result<Vec<u32>, u32> =
            map(&inputs, |x| if x % 7 == 6 { Err(*x) } else { Ok(*x) });
        assert_eq!(failed.unwrap_err(), 6);
        let none: Result<Vec<u32>, u32> = map(&[], |x: &u32| Ok(*x));
        assert!(none.unwrap().is_empty());
    }
}
