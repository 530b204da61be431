//! The port of a device server (RFC 2217) against ser2net: on a pty, and before
//! a simulated device server, because a pty has no modem lines and no break.
#![cfg(target_os = "linux")]

mod needs_ser2net {
    use std::cell::RefCell;
    use std::thread;
    use std::time::{Duration, Instant};

    use rfc2217::{FlowControl, Purge};
    use rustix::fs::{Mode, OFlags, open};
    use softplug_abi::{LineErrorKind, LinkDownReason, ModemLines};
    use softplug_live::device_server::{DeviceServer, Seen};
    use softplug_live::port::read_line;
    use softplug_live::pty::{PtyPair, PtyPort};
    use softplug_live::{Port, PortError, PortOptions, PortSpec, ReadOutcome};
    use softplug_machines::Signal;

    use crate::lanes::Bench;
    use crate::net::killed::{self, Server};
    use crate::net::machine::{Machine, PATIENCE};
    use crate::net::port::*;
    use crate::net::ser2net::Ser2net;

    /// Opens a port of ser2net's, which lets the next client in only once it has
    /// put the last one away.
    fn open_port(spec: &PortSpec, options: &PortOptions) -> Port {
        let end = Instant::now() + PATIENCE;
        loop {
            match Port::open(spec, options) {
                Ok(port) => return port,
                Err(error) => assert!(Instant::now() < end, "{error}"),
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn on_pty(pair: &PtyPair) -> Ser2net {
        let device = pair.slave_path().display();
        Ser2net::start(format_args!("serialdev,{device},9600n81,local"))
    }

    fn all_bytes(count: usize) -> Vec<u8> {
        (0..=255).chain([0xFF, 0xFF, 0, 0x11, 0x13, 0xFF]).cycle().take(count).collect()
    }

    #[test]
    fn data_and_settings_on_a_pty() {
        let pair = PtyPair::open().unwrap();
        let slave = open(pair.slave_path(), OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
        let server = on_pty(&pair);
        let mut port = open_port(&rfc2217(server.address()), &options("19200 7E2"));
        assert_eq!(port.line().baud, 19_200);
        // The rate is all that a pty keeps of it.
        assert_eq!(read_line(&slave).unwrap().baud, 19_200);
        let Port::Rfc2217(_) = &port else { panic!("{port:?}") };

        let mut back = Port::Pty(PtyPort::new(pair, port.line()));
        let (mut to_port, mut to_machine) = (Heard::default(), Heard::default());
        let all = all_bytes(20_000);
        let (mut sent, mut returned) = (0, 0);
        // Both ways at once.
        while sent < all.len() || returned < all.len() {
            sent += port.write(&all[sent..all.len().min(sent + 64)]).unwrap();
            returned += back.write(&all[returned..all.len().min(returned + 64)]).unwrap();
            serve(&mut port, &mut to_port, |_, _| true);
            serve(&mut back, &mut to_machine, |_, _| true);
        }
        serve(&mut port, &mut to_port, |_, heard| heard.bytes.len() >= all.len());
        serve(&mut back, &mut to_machine, |_, heard| heard.bytes.len() >= all.len());
        assert!(to_port.bytes == all && to_machine.bytes == all);
        serve(&mut port, &mut to_port, |port, _| match port {
            Port::Rfc2217(port) => port.signature() == Some("ser2net"),
            _ => panic!("{port:?}"),
        });
    }

    #[test]
    fn a_port_that_another_client_has_is_refused_with_a_word_of_it() {
        let pair = PtyPair::open().unwrap();
        let server = on_pty(&pair);
        let spec = rfc2217(server.address());
        let _first = open_port(&spec, &options("9600"));
        let error = Port::open(&spec, &options("9600")).unwrap_err();
        assert!(error.to_string().contains("maybe another client has its port"), "{error}");
    }

    #[test]
    fn modem_lines_break_and_purge_pass_to_a_device_server() {
        let machine = Machine::holding_after(1);
        let far = DeviceServer::start("127.0.0.1:0".parse().unwrap(), machine.clone()).unwrap();
        far.inject(Signal::ModemLines { lines: ModemLines(0x0F), on: ModemLines::DSR });
        let (host, number) = (far.address().ip(), far.address().port());
        let near = Ser2net::start(format_args!("telnet(rfc2217),tcp,{host},{number}"));
        let mut port = open_port(&rfc2217(near.address()), &device_options("19200"));
        let mut heard = Heard::default();
        let is_set = |seen: &[Seen]| {
            seen.iter().any(|seen| {
                matches!(seen, Seen::Settings(settings)
                    if settings.baud_rate == 19_200 && settings.flow_control == FlowControl::XonXoff)
            })
        };
        assert!(far.wait_until(PATIENCE, is_set), "{:?}", far.seen());

        for on in [ModemLines::CTS, ModemLines::CTS.union(ModemLines::DCD), ModemLines::DSR] {
            far.inject(Signal::ModemLines { lines: ModemLines(0x0F), on });
            let inputs = Some(on.0);
            serve(&mut port, &mut heard, |port, _| {
                port.modem_lines().map(|(_, now)| now.0 & 0x0F) == inputs
            });
        }
        let saw = |wanted| far.wait_until(PATIENCE, |seen| seen.contains(&wanted));
        port.set_modem_lines(ModemLines::OUTPUTS, ModemLines::DTR).unwrap();
        assert!(saw(Seen::Rts(false)), "{:?}", far.seen());
        port.set_modem_lines(ModemLines::OUTPUTS, ModemLines::RTS).unwrap();
        assert!(saw(Seen::Dtr(false)) && saw(Seen::Rts(true)), "{:?}", far.seen());

        write_all(&mut port, &mut heard, b"N10 X1");
        machine.wait_until(|state| state.received == b"N");
        port.discard_output().unwrap();
        let purged = |seen: &Seen| matches!(seen, Seen::Purge(Purge::Transmit | Purge::Both));
        assert!(far.wait_until(PATIENCE, |seen| seen.iter().any(purged)), "{:?}", far.seen());
        port.start_break().unwrap();
        assert!(saw(Seen::Break(true)), "{:?}", far.seen());
        port.stop_break().unwrap();
        assert!(saw(Seen::Break(false)), "{:?}", far.seen());
        assert!(machine.state().damaged.contains(&LineErrorKind::Break));
        far.inject(Signal::Character(0x11));
        write_all(&mut port, &mut heard, b"M30");
        machine.wait_until(|state| state.received.ends_with(b"M30"));
    }

    #[test]
    fn a_machine_that_holds_is_not_taken_for_a_dead_server() {
        let pair = PtyPair::open().unwrap();
        let server = on_pty(&pair);
        let mut port = open_port(&rfc2217(server.address()), &options("115200"));
        // Nobody reads the pty: everything on the way fills up.
        let (mut written, mut refused) = (0, 0);
        while refused < 200 {
            let count = port.write(&[b'N'; 64]).unwrap();
            written += count;
            refused = if count == 0 { refused + 1 } else { 0 };
            thread::sleep(Duration::from_micros(500));
        }
        let mut heard = Heard::default();
        for seconds in (0..3_600).step_by(5) {
            port.handle_timeout(softplug_abi::Micros::from_secs(seconds)).unwrap();
            serve(&mut port, &mut heard, |_, _| true);
        }
        let mut back = Port::Pty(PtyPort::new(pair, port.line()));
        let mut to_machine = Heard::default();
        while to_machine.bytes.len() < written {
            serve(&mut port, &mut heard, |_, _| true);
            let before = to_machine.bytes.len();
            serve(&mut back, &mut to_machine, |_, heard| heard.bytes.len() > before);
        }
        assert!(to_machine.bytes == vec![b'N'; written]);
    }

    #[test]
    fn a_server_that_was_killed_is_found_and_taken_up_again() {
        let pair = PtyPair::open().unwrap();
        let mut server = on_pty(&pair);
        let spec = rfc2217(server.address());
        let mut port = open_port(&spec, &options("115200"));
        let mut heard = Heard::default();
        pair.write(b"one").unwrap();
        serve(&mut port, &mut heard, |_, heard| heard.bytes == b"one");
        server.kill();
        let lost = serve_or_lose(&mut port, &mut heard, |_, _| false);
        assert_eq!(lost, Err(LinkDownReason::Disconnected));
        let error = Port::open(&spec, &options("115200")).unwrap_err();
        assert!(matches!(error, PortError::Connect { .. }), "{error}");
        server.start_again();
        let mut port = open_port(&spec, &options("115200"));
        pair.write(b"two").unwrap();
        serve(&mut port, &mut heard, |_, heard| heard.bytes == b"onetwo");
    }

    /// ser2net on a pty, whose far end the test reads.
    struct OnPty {
        server: Ser2net,
        machine: PtyPair,
        received: RefCell<Vec<u8>>,
    }

    impl OnPty {
        /// Reads what is there.
        fn read(&self) -> bool {
            let mut buffer = [0; 512];
            let outcome = self.machine.read(&mut buffer).unwrap();
            if let ReadOutcome::Read(count) = outcome {
                self.received.borrow_mut().extend_from_slice(&buffer[..count]);
            }
            matches!(outcome, ReadOutcome::Read(_))
        }
    }

    impl Server for OnPty {
        fn kill(&mut self) {
            self.server.kill();
        }

        fn restart(&mut self) {
            self.server.start_again();
        }

        fn wait_received(&self, count: usize) -> Vec<u8> {
            let end = Instant::now() + PATIENCE;
            while self.received.borrow().len() < count {
                if !self.read() {
                    thread::sleep(Duration::from_millis(1));
                }
                assert!(Instant::now() < end, "{} bytes", self.received.borrow().len());
            }
            self.received.borrow().clone()
        }

        fn received(&self) -> Vec<u8> {
            while self.read() {}
            self.received.borrow().clone()
        }
    }

    #[test]
    fn a_server_that_is_killed_in_mid_job_is_taken_up_again() {
        let machine = PtyPair::open().unwrap();
        let server = on_pty(&machine);
        let spec = rfc2217(server.address());
        let mut on_pty = OnPty { server, machine, received: RefCell::default() };
        let mut bench = Bench::start();
        let lane = bench.add_with(115_200, |setup| {
            setup.port = spec;
            setup.port_options = options("115200");
        });
        killed::kill_in_mid_job(&mut bench, lane, &mut on_pty);
    }
}
