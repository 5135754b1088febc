//! How a call ended.

/// How a call ended. Below 100 there is an answer, and its status is this one, as the program prints it; from 100 on there is none.
/// Use a pose unseen only where the status is RESIGHT_STATUS_OK.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// One pose, and its residual agrees with the stated noise; for calls without an answer: done.
    Ok = 0,
    /// Two poses fit; the answer holds both.
    Ambiguous = 1,
    /// The points do not determine the pose: there is none.
    Degenerate = 2,
    /// There is a pose, but its residual is far above the stated noise.
    Inconsistent = 3,
    /// The target is not in the image: there is no pose.
    NotFound = 4,
    /// Several explanations fit.
    Undecided = 5,
    /// No chain of observations joins all cameras.
    NotConnected = 6,
    /// The numbers agree, but a stated size or unit hardly exists, such as squares of 25 m.
    Implausible = 7,
    /// Anything else that kept the answer back.
    Error = 8,
    /// An argument that is none: null, misaligned, too large, not UTF-8, or numbers that cannot be.
    InvalidArgument = 100,
    /// A file that cannot be read, or holds something else.
    File = 101,
    /// A target that cannot be detected in images.
    Target = 102,
    /// A request that contradicts itself.
    Request = 103,
    /// A mistake of this library; please report it.
    Internal = 104,
}

impl From<resight::Status> for Status {
    fn from(status: resight::Status) -> Self {
        match status {
            resight::Status::Ok => Status::Ok,
            resight::Status::Ambiguous => Status::Ambiguous,
            resight::Status::Degenerate => Status::Degenerate,
            resight::Status::Inconsistent => Status::Inconsistent,
            resight::Status::NotFound => Status::NotFound,
            resight::Status::Undecided => Status::Undecided,
            resight::Status::NotConnected => Status::NotConnected,
            resight::Status::Implausible => Status::Implausible,
            resight::Status::Error => Status::Error,
        }
    }
}

/// Why a call has no answer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub status: Status,
    pub message: String,
}

impl Refusal {
    /// Of an argument that is none.
    pub fn argument(message: impl Into<String>) -> Self {
        Refusal { status: Status::InvalidArgument, message: message.into() }
    }

    /// Of this library.
    pub fn mistake() -> Self {
        let message = "the library panicked, which is a mistake of its own; please report it".to_owned();
        Refusal { status: Status::Internal, message }
    }
}

impl From<resight::Error> for Refusal {
    fn from(reason: resight::Error) -> Self {
        let status = match reason {
            resight::Error::File(_) => Status::File,
            resight::Error::Detect(_) => Status::Target,
            resight::Error::Math(_) => Status::InvalidArgument,
            _ => Status::Request,
        };
        Refusal { status, message: reason.to_string() }
    }
}

impl From<resight::FileError> for Refusal {
    fn from(reason: resight::FileError) -> Self {
        resight::Error::from(reason).into()
    }
}

impl From<resight::core::Error> for Refusal {
    fn from(reason: resight::core::Error) -> Self {
        resight::Error::from(reason).into()
    }
}
