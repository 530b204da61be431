//! Bodies that are too large to be held: read as they come, by code that blocks.
//!
//! What the reader does not take holds the client back through TCP. A body that breaks off never
//! looks like one that has ended.

use std::io::{self, Read};

use axum::body::{Body, Bytes};
use axum::http::StatusCode;
use tokio::sync::mpsc;
use tokio::task::spawn_blocking;
use tokio::time::{Instant, timeout};
use tokio_stream::StreamExt as _;

use super::limits::Pace;
use super::problem::Problem;

/// Pieces between the network and the reader.
const PIECES: usize = 4;

enum Piece {
    Bytes(Bytes),
    End,
}

/// The body, for code that blocks.
struct BodyReader {
    pieces: mpsc::Receiver<Piece>,
    rest: Bytes,
    ended: bool,
}

impl Read for BodyReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.rest.is_empty() && !self.ended {
            match self.pieces.blocking_recv() {
                Some(Piece::Bytes(bytes)) => self.rest = bytes,
                Some(Piece::End) => self.ended = true,
                None => return Err(io::ErrorKind::UnexpectedEof.into()),
            }
        }
        let length = self.rest.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.rest.split_to(length));
        Ok(length)
    }
}

/// Does `work` with the body as it comes, on a thread of its own.
pub(super) async fn receive<T, F>(body: Body, pace: Pace, most: u64, work: F) -> Result<T, Problem>
where
    T: Send + 'static,
    F: FnOnce(&mut dyn Read) -> Result<T, Problem> + Send + 'static,
{
    let (sender, pieces) = mpsc::channel(PIECES);
    let mut reader = BodyReader { pieces, rest: Bytes::new(), ended: false };
    let worker = spawn_blocking(move || work(&mut reader));
    let came = pass_on(body, sender, pace, most).await;
    let done = worker.await.map_err(|_| Problem::ours())?;
    came.and(done)
}

/// Ends without error too if the reader wants no more: then it has its own reason.
async fn pass_on(
    body: Body,
    pieces: mpsc::Sender<Piece>,
    pace: Pace,
    most: u64,
) -> Result<(), Problem> {
    let too_large = || {
        let sentence =
            format!("more than {most} bytes are not taken; `upload-bytes` says how many");
        Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, sentence))
    };
    if axum::body::HttpBody::size_hint(&body).lower() > most {
        return too_large();
    }
    let mut body = body.into_data_stream();
    let mut total = 0_u64;
    let mut since_look = 0_u64;
    let mut patience = pace.patience;
    loop {
        let began = Instant::now();
        let bytes = match timeout(patience, body.next()).await {
            Ok(Some(Ok(bytes))) => bytes,
            Ok(Some(Err(_))) => return Err(Problem::bad("the body broke off")),
            Ok(None) => {
                let _ = pieces.send(Piece::End).await;
                return Ok(());
            }
            Err(_) => {
                let sentence = "the body comes too slowly";
                return Err(Problem::new(StatusCode::REQUEST_TIMEOUT, sentence));
            }
        };
        patience = patience.saturating_sub(began.elapsed());
        total += bytes.len() as u64;
        since_look += bytes.len() as u64;
        if since_look >= pace.bytes {
            (since_look, patience) = (0, pace.patience);
        }
        if total > most {
            return too_large();
        }
        if pieces.send(Piece::Bytes(bytes)).await.is_err() {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::UPLOAD_PACE;
    use super::*;

    fn run<T>(future: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .unwrap()
            .block_on(future)
    }

    fn read(reader: &mut dyn Read) -> Result<Vec<u8>, Problem> {
        let mut bytes = Vec::new();
        let read = reader.read_to_end(&mut bytes);
        read.map(|_| bytes).map_err(|error| Problem::bad(error.kind().to_string()))
    }

    fn pieces(pieces: &[Result<&'static str, io::ErrorKind>]) -> Body {
        let pieces: Vec<_> = pieces
            .iter()
            .map(|piece| piece.map(|text| Bytes::from_static(text.as_bytes())))
            .map(|piece| piece.map_err(io::Error::from))
            .collect();
        Body::from_stream(tokio_stream::iter(pieces))
    }

    #[test]
    fn a_body_arrives_whole() {
        let body = pieces(&[Ok("G0"), Ok(""), Ok(" X1\n"), Ok("M30")]);
        assert_eq!(run(receive(body, UPLOAD_PACE, 9, read)).unwrap(), b"G0 X1\nM30");
        assert_eq!(run(receive(Body::empty(), UPLOAD_PACE, 0, read)).unwrap(), b"");
    }

    #[test]
    fn one_that_breaks_off_is_no_whole_one() {
        let body = pieces(&[Ok("G0"), Err(io::ErrorKind::ConnectionReset)]);
        let seen = |reader: &mut dyn Read| {
            assert!(read(reader).is_err());
            Ok(())
        };
        assert_eq!(run(receive(body, UPLOAD_PACE, 9, seen)).unwrap_err().status, 400);
    }

    #[test]
    fn one_that_is_too_large_is_no_whole_one() {
        let seen = |reader: &mut dyn Read| {
            assert!(read(reader).is_err());
            Ok(())
        };
        let body = pieces(&[Ok("G0 X1"), Ok("X")]);
        assert_eq!(run(receive(body, UPLOAD_PACE, 5, seen)).unwrap_err().status, 413);
        assert_eq!(
            run(receive(Body::from("G0 X1X"), UPLOAD_PACE, 5, seen)).unwrap_err().status,
            413
        );
    }

    #[test]
    fn a_reader_that_refuses_says_why() {
        let body = pieces(&[Ok("a"); 20]);
        let refuse = |_: &mut dyn Read| Err::<(), _>(Problem::unavailable("the disk is full"));
        assert_eq!(
            run(receive(body, UPLOAD_PACE, 99, refuse)).unwrap_err().detail,
            "the disk is full"
        );
    }
}
