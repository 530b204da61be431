//! What wakes a thread that polls.

use std::sync::Arc;
use std::task::{Wake, Waker};

/// A waker of a poll, for buffers that wake whoever fills or empties them.
///
/// ```
/// use softplug_unit_uplink::waker_of;
/// use std::sync::Arc;
///
/// let poll = mio::Poll::new()?;
/// let waker = Arc::new(mio::Waker::new(poll.registry(), mio::Token(0))?);
/// waker_of(waker).wake();
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn waker_of(waker: Arc<mio::Waker>) -> Waker {
    struct OfPoll(Arc<mio::Waker>);
    impl Wake for OfPoll {
        fn wake(self: Arc<Self>) {
            // A poll that is gone needs none.
            let _ = self.0.wake();
        }
    }
    Waker::from(Arc::new(OfPoll(waker)))
}
