//! How long a subnegotiation may be. The crate `rfc2217` gives up on one of more than 1,024 bytes
//! and takes the rest of it for data, which would go to the machine, or come from it. Nobody
//! who speaks the protocol sends one of more than some hundred: before that, the connection ends.

/// Bytes of a subnegotiation, escapes counted once. Signatures are the longest that there are.
const MOST: u32 = 1_000;

const IAC: u8 = 255;
const SB: u8 = 250;

/// Follows a Telnet stream, as far as subnegotiations are concerned.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct SubnegotiationBound {
    state: State,
    length: u32,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
enum State {
    #[default]
    Data,
    /// After an IAC.
    Command,
    /// After the command of an option.
    Option,
    Inside,
    /// After an IAC within.
    InsideCommand,
}

impl SubnegotiationBound {
    /// How much of the input may be decoded: all of it, or what stands before the byte that
    /// makes a subnegotiation too long.
    pub(crate) fn within(mut self, input: &[u8]) -> usize {
        input.iter().position(|byte| !self.take(*byte)).unwrap_or(input.len())
    }

    /// This much of the input was decoded.
    pub(crate) fn pass(&mut self, decoded: &[u8]) {
        for byte in decoded {
            self.take(*byte);
        }
    }

    /// `false`: it would be too long with this byte.
    fn take(&mut self, byte: u8) -> bool {
        self.state = match (self.state, byte) {
            (State::Data, IAC) => State::Command,
            (State::Inside, IAC) => State::InsideCommand,
            (State::Inside, _) | (State::InsideCommand, IAC) => {
                self.length += 1;
                State::Inside
            }
            // A command within breaks a subnegotiation off.
            (State::Command | State::InsideCommand, SB) => {
                self.length = 0;
                State::Inside
            }
            (State::Command | State::InsideCommand, 251..=254) => State::Option,
            (State::Data | State::Option | State::Command | State::InsideCommand, _) => State::Data,
        };
        self.state != State::Inside || self.length <= MOST
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rfc2217::Server;

    use super::*;

    const SE: u8 = 240;

    fn of(body: &[u8]) -> Vec<u8> {
        [&[IAC, SB, 44, 0], body, &[IAC, SE]].concat()
    }

    #[test]
    fn only_what_is_too_long_is_found_and_where() {
        let bound = SubnegotiationBound::default();
        for fits in [of(&[7; 998]), of(&[IAC; 2 * 998]), vec![IAC; 4_000], vec![0; 5_000]] {
            assert_eq!(bound.within(&fits), fits.len());
        }
        assert_eq!(bound.within(&of(&[7; 999])), 4 + 998);
        assert_eq!(bound.within(&of(&[IAC; 2 * 999])), 4 + 2 * 999 - 1);
    }

    proptest! {
        /// However it comes, nothing of an overlong one is ever data for the crate.
        #[test]
        fn what_passes_has_no_byte_of_a_subnegotiation_as_data(
            before in prop::collection::vec(prop::sample::select(&[0x41, IAC, SB, SE, 251, 44][..]), 0..12),
            length in 990_usize..3_000,
            piece in 1_usize..700,
        ) {
            let mut input = before;
            // Whatever was under way is over.
            input.extend([IAC, SE, IAC, SE]);
            let begin = input.len();
            input.extend(of(&vec![0x42; length]));
            let mut bound = SubnegotiationBound::default();
            let mut server = Server::new(rfc2217::PortSettings::default());
            let mut payload = vec![0; 4_000];
            let mut at = 0;
            let mut data = 0;
            'pieces: for piece in input.chunks(piece) {
                let within = bound.within(piece);
                let mut taken = 0;
                while taken < within {
                    let progress = server.receive_into(&piece[taken..within], &mut payload);
                    taken += progress.consumed;
                    let (passed, _) = payload.split_at(progress.payload_len);
                    data += passed.iter().map(|byte| usize::from(*byte == 0x42)).sum::<usize>();
                    while server.poll_event().is_some() {}
                    while server.has_output() {
                        let count = server.output().len();
                        server.consume_output(count);
                    }
                }
                bound.pass(&piece[..taken]);
                at += taken;
                if within < piece.len() {
                    break 'pieces;
                }
            }
            prop_assert_eq!(data, 0);
            let is_over = length + 2 > MOST as usize;
            prop_assert_eq!(at, if is_over { begin + 2 + MOST as usize } else { input.len() });
        }
    }
}
