//! Turning the panics of a decoder into a value.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// True while this thread runs something whose panics are caught here.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `decode`; nothing when it panics.
///
/// The panic is part of reading a broken file, so its message is not printed: the first call puts a hook before
/// the one that prints, which passes on every other panic.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    // The hook cannot be changed by a thread that is on its way down.
    if !std::thread::panicking() {
        HOOK.call_once(|| {
            let before = take_hook();
            set_hook(Box::new(move |panic| {
                if !GUARDED.get() {
                    before(panic);
                }
            }));
        });
    }
    let outer = GUARDED.replace(true);
    // What `decode` left half-done is dropped here with everything it owned.
    let done = catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(outer);
    done.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_nothing_and_the_next_call_is_fine() {
        let broken: Option<u8> = guarded(|| panic!("offset out of bounds"));
        assert_eq!(broken, None);
        assert_eq!(guarded(|| 7), Some(7));
        assert!(!GUARDED.get());
    }
}
