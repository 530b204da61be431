//! The numbers by which host and plug-in call what they speak of.

use core::fmt;

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident)+) => {
        $(
            $(#[$doc])*
            #[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
            #[cfg_attr(feature = "manifest", derive(serde::Serialize, serde::Deserialize))]
            pub struct $name(pub u32);

            impl $name {
                /// Stands where there is none.
                pub const NONE: Self = Self(0);

                /// The number behind this one; 1 behind the largest, as none is 0.
                #[must_use]
                #[inline]
                pub fn next(self) -> Self {
                    Self(self.0.wrapping_add(1).max(1))
                }
            }

            impl fmt::Debug for $name {
                fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    self.0.fmt(f)
                }
            }

            impl fmt::Display for $name {
                fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    self.0.fmt(f)
                }
            }
        )+
    };
}

ids! {
    /// A job's number: chosen by the host, never 0, and none comes twice while a link is open.
    ///
    /// ```
    /// use softplug_abi::{Event, JobId};
    ///
    /// let event = Event::JobEnd { job: JobId(7) };
    /// let mut payload = [0; 4];
    /// assert_eq!(event.encode(&mut payload), Ok(4));
    /// assert_eq!(payload, [7, 0, 0, 0]);
    /// ```
    JobId
    /// A delivery's number: chosen by the plug-in, never 0; it may come again when the delivery has ended.
    ///
    /// ```
    /// use softplug_abi::{Action, ActionWriter, DeliveryId};
    ///
    /// let mut buffer = [0; 16];
    /// let mut writer = ActionWriter::new(&mut buffer);
    /// writer.push(&Action::Deliver { delivery: DeliveryId(1), bytes: b"G1" }).unwrap();
    /// assert_eq!(writer.written(), [12, 0, 6, 0, 1, 0, 0, 0, b'G', b'1']);
    /// ```
    DeliveryId
    /// The number of a request to the host: chosen by the plug-in, never 0.
    ///
    /// ```
    /// use softplug_abi::{Action, RequestId};
    ///
    /// let withdrawn = Action::Withdraw { request: RequestId(3) };
    /// assert_eq!(format!("{withdrawn:?}"), "Withdraw { request: 3 }");
    /// ```
    RequestId
    /// The number of a mark behind bytes that are to leave: chosen by the plug-in, never 0.
    ///
    /// ```
    /// use softplug_abi::{Event, EventKind, MarkId, MarkState};
    ///
    /// let event = Event::decode(EventKind::Mark, &[9, 0, 0, 0, 1])?;
    /// assert!(matches!(event, Event::Mark { mark: MarkId(9), .. }));
    /// # Ok::<(), softplug_abi::MalformedReason>(())
    /// ```
    MarkId
}
