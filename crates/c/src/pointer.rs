//! Pointers of the caller, checked as far as they can be: null, alignment, size.

use crate::status::Refusal;
use std::ffi::{CStr, c_char};
use std::path::Path;

/// A place of the caller for a result.
pub struct Out<T>(*mut T);

fn check<T>(name: &str, pointer: *const T) -> Result<(), Refusal> {
    if pointer.is_null() {
        return Err(Refusal::argument(format!("{name} is a null pointer")));
    }
    if !pointer.is_aligned() {
        let needed = align_of::<T>();
        return Err(Refusal::argument(format!(
            "{name} is not aligned; a multiple of {needed} bytes is needed"
        )));
    }
    Ok(())
}

/// What a pointer points to.
///
/// # Safety
/// It is null or points to a `T` that lives and does not change for `'a`.
pub unsafe fn borrowed<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, Refusal> {
    check(name, pointer)?;
    // SAFETY: neither null nor misaligned; the rest is the caller's promise.
    Ok(unsafe { &*pointer })
}

/// So many values; the pointer may be null where there are none.
///
/// # Safety
/// It is null or points to `n` values that live and do not change for `'a`.
pub unsafe fn slice<'a, T>(name: &str, pointer: *const T, n: usize) -> Result<&'a [T], Refusal> {
    if n == 0 {
        return Ok(&[]);
    }
    check(name, pointer)?;
    n.checked_mul(size_of::<T>())
        .filter(|bytes| *bytes <= isize::MAX as usize)
        .ok_or_else(|| too_many(name, n))?;
    // SAFETY: neither null nor misaligned, nor larger than memory can be; the rest is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, n) })
}

/// Rows of `N` numbers each.
///
/// # Safety
/// It is null or points to `n` times `N` numbers that live and do not change for `'a`.
pub unsafe fn rows<'a, const N: usize>(
    name: &str,
    pointer: *const f64,
    n: usize,
) -> Result<&'a [[f64; N]], Refusal> {
    // SAFETY: `N` numbers in a row are laid out as one array of `N`.
    unsafe { slice(name, pointer.cast::<[f64; N]>(), n) }
}

pub fn too_many(name: &str, n: usize) -> Refusal {
    Refusal::argument(format!("{name}: {n} values are more than memory can hold"))
}

/// A text that ends with a zero.
///
/// # Safety
/// It is null or points to bytes with a zero at their end that live and do not change for `'a`.
pub unsafe fn text<'a>(name: &str, pointer: *const c_char) -> Result<&'a str, Refusal> {
    check(name, pointer)?;
    // SAFETY: not null; the rest is the caller's promise.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str()
        .map_err(|at| Refusal::argument(format!("{name} is not UTF-8 from byte {} on", at.valid_up_to())))
}

/// The same, where null stands for none.
///
/// # Safety
/// As of `text`.
pub unsafe fn optional_text<'a>(name: &str, pointer: *const c_char) -> Result<Option<&'a str>, Refusal> {
    match pointer.is_null() {
        true => Ok(None),
        // SAFETY: the caller's promise.
        false => unsafe { text(name, pointer) }.map(Some),
    }
}

/// The path of a file: UTF-8, as everywhere in Resight.
///
/// # Safety
/// As of `text`.
pub unsafe fn path<'a>(pointer: *const c_char) -> Result<&'a Path, Refusal> {
    // SAFETY: the caller's promise.
    unsafe { text("file", pointer) }.map(Path::new)
}

impl<T> Out<T> {
    /// # Safety
    /// The pointer is null or points to memory for a `T` that nothing else uses until the call ends.
    pub unsafe fn new(name: &str, pointer: *mut T) -> Result<Self, Refusal> {
        check(name, pointer)?;
        Ok(Out(pointer))
    }

    /// Writes a value; what was there, if anything, is not dropped.
    pub fn write(&self, value: T) {
        // SAFETY: `new` took the promise.
        unsafe { self.0.write(value) }
    }
}

impl<T> Out<*mut T> {
    /// Holds no handle until it is given one.
    ///
    /// # Safety
    /// As of `new`.
    pub unsafe fn handle(name: &str, pointer: *mut *mut T) -> Result<Self, Refusal> {
        // SAFETY: the caller's promise.
        let out = unsafe { Out::new(name, pointer) }?;
        out.write(std::ptr::null_mut());
        Ok(out)
    }

    /// Gives a handle, which its `_free` takes back.
    pub fn give(&self, value: T) {
        self.write(Box::into_raw(Box::new(value)));
    }
}

/// Takes a handle back.
///
/// # Safety
/// It is null, or comes from `Out::give` and is used no more.
pub unsafe fn free<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: of a box, and the last use of it.
        drop(unsafe { Box::from_raw(pointer) });
    }
}

/// Copies values into an array of the caller that has room for exactly these.
///
/// # Safety
/// The pointer is null or points to memory for `n` values that nothing else uses until the call ends.
pub unsafe fn slice_out<T: Copy>(name: &str, pointer: *mut T, n: usize, values: &[T]) -> Result<(), Refusal> {
    if n != values.len() {
        return Err(Refusal::argument(format!("{name}: n is {n}; there are {}", values.len())));
    }
    if n != 0 {
        check(name, pointer)?;
        // SAFETY: neither null nor misaligned, and as long; the rest is the caller's promise.
        unsafe { std::ptr::copy_nonoverlapping(values.as_ptr(), pointer, n) };
    }
    Ok(())
}
