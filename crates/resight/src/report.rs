//! Answers for people: verdicts, numbers in words, and a self-contained page.

pub mod html;
pub mod rig;
pub mod truth;
pub mod turned;
pub mod verdict;
pub mod words;

pub use rig::rig_page;
