//! Processes many inputs on all cores, with results in the order of the inputs, block by block, so that memory stays bounded.
//!
//! Each process has one pool of threads. A process made by `fork` has none of its parent's threads, and would wait for them for ever: each of
//! its jobs therefore gets a pool of its own.

use crate::Error;
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::atomic::{AtomicU32, Ordering};

/// The process whose threads the common pool holds; 0 before any job. It is an atomic, because a lock could be held while a process forks.
static POOL_IS_OF: AtomicU32 = AtomicU32::new(0);

/// Runs `work`, in which all parallel iterators, including those of other crates, use all cores of this process, also after `fork`.
pub fn on_all_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let this = std::process::id();
    let owner = match POOL_IS_OF.compare_exchange(0, this, Ordering::Relaxed, Ordering::Relaxed) {
        Ok(_) => this,
        Err(owner) => owner,
    };
    if owner == this || rayon::current_thread_index().is_some() {
        return work();
    }
    let threads = rayon::ThreadPoolBuilder::new;
    // Where no thread can be started, the current one does all the work.
    match threads().build().or_else(|_| threads().num_threads(1).use_current_thread().build()) {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

/// Is called with the number of inputs done and of all inputs; returning false ends the job.
type Observer = Box<dyn FnMut(usize, usize) -> bool>;

thread_local! {
    /// The observer of the job that this thread runs.
    static OBSERVER: RefCell<Option<Observer>> = const { RefCell::new(None) };
}

/// Runs a job over many images with an observer, which is called after each image with the numbers of images done and of all. Where it returns
/// false, the job soon ends with an error.
pub fn observed<T>(observer: impl FnMut(usize, usize) -> bool + 'static, job: impl FnOnce() -> T) -> T {
    struct Forget;
    impl Drop for Forget {
        fn drop(&mut self) {
            OBSERVER.with_borrow_mut(|observer| *observer = None);
        }
    }
    OBSERVER.with_borrow_mut(|heard| *heard = Some(Box::new(observer)));
    let _forget = Forget;
    job()
}

/// Calls the observer of this thread's job, if it has one.
///
/// # Errors
/// The observer ends the job.
pub(crate) fn report(n_done: usize, n_all: usize) -> Result<(), Error> {
    let go_on = |observer: &mut Option<Observer>| observer.as_mut().is_none_or(|hear| hear(n_done, n_all));
    match OBSERVER.with_borrow_mut(go_on) {
        true => Ok(()),
        false => Err(Error::request(format!("ended at the caller's wish after {n_done} of {n_all}"))),
    }
}

/// Applies `work` to every input on all cores and passes the results to `done` in input order: the first results arrive while later inputs wait.
///
/// # Errors
/// The first error that `done` returns.
pub fn in_order<T: Sync, R: Send, E>(
    inputs: &[T],
    work: impl Fn(&T) -> R + Sync,
    done: impl FnMut(R) -> Result<(), E>,
) -> Result<(), E> {
    let answers = |block: &[T]| on_all_cores(|| block.par_iter().map(&work).collect());
    in_blocks(inputs, 1024, |block| Ok(answers(block)), done)
}

/// Works as [`in_order`], with one detector (or several) per thread, because the C library keeps state in it.
///
/// # Errors
/// The error of a detector that cannot be built, before any work; the first error that `done` returns.
pub fn detect_in_order<T: Sync, D, R: Send, F: Send, E: From<F>>(
    inputs: &[T],
    detector: impl Fn() -> Result<D, F> + Sync,
    work: impl Fn(&mut D, &T) -> R + Sync,
    done: impl FnMut(R) -> Result<(), E>,
) -> Result<(), E> {
    detector()?; // Says now what is wrong with the target, once.
    let look = |detector_of_thread: &mut Option<D>, input: &T| -> Result<R, F> {
        match detector_of_thread {
            Some(detector) => Ok(work(detector, input)),
            none => Ok(work(none.insert(detector()?), input)),
        }
    };
    let answers = |block: &[T]| -> Result<Vec<R>, E> {
        let found: Result<Vec<R>, F> = on_all_cores(|| block.par_iter().map_init(|| None, look).collect());
        Ok(found?)
    };
    in_blocks(inputs, 4 * rayon::current_num_threads(), answers, done)
}

fn in_blocks<T, R, E>(
    inputs: &[T],
    size: usize,
    answers: impl Fn(&[T]) -> Result<Vec<R>, E>,
    mut done: impl FnMut(R) -> Result<(), E>,
) -> Result<(), E> {
    inputs.chunks(size).try_for_each(|block| answers(block)?.into_iter().try_for_each(&mut done))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Results arrive in the order of the inputs, however the threads run, and the first error ends the work.
    #[test]
    fn results_come_in_order_and_errors_end_the_work() {
        let inputs: Vec<usize> = (0..5000).collect();
        let mut seen = Vec::new();
        let done = |x: usize| -> Result<(), String> {
            seen.push(x);
            if x == 4000 { Err("enough".into()) } else { Ok(()) }
        };
        assert_eq!(in_order(&inputs, |x| *x, done), Err("enough".to_string()));
        assert_eq!(seen, inputs[..=4000]);
        let detector = || -> Result<usize, String> { Err("no detector".into()) };
        let found: Result<(), String> = detect_in_order(&inputs, detector, |d, _| *d, |_| Ok(()));
        assert_eq!(found, Err("no detector".to_string()));
    }

    /// An observer is called for its own job only, and can end it.
    #[test]
    fn an_observer_hears_each_input_and_can_end_the_job() {
        let heard = std::rc::Rc::new(RefCell::new(Vec::new()));
        let ear = heard.clone();
        let job = || -> Result<(), Error> {
            let mut n_done = 0;
            in_order(
                &[1, 2, 3, 4],
                |x| *x,
                |_| {
                    n_done += 1;
                    report(n_done, 4)
                },
            )
        };
        let ended = observed(
            move |n_done, n_all| {
                ear.borrow_mut().push((n_done, n_all));
                n_done < 2
            },
            job,
        );
        assert!(ended.is_err_and(|reason| reason.to_string().contains("after 2 of 4")));
        assert_eq!(*heard.borrow(), [(1, 4), (2, 4)]);
        assert!(job().is_ok());
        assert_eq!(heard.borrow().len(), 2);
    }
}
