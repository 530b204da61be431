//! A file as an answer.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read as _};

use axum::body::{Body, Bytes};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse as _, Response};
use tokio::sync::mpsc;
use tokio::task::spawn_blocking;
use tokio_stream::wrappers::ReceiverStream;

use crate::gateway::Download;

/// Read at a time, in bytes.
const PIECE: usize = 64 * 1024;

/// Sends the file as it was when it was opened, as fast as it is taken.
pub(super) fn answer(download: Download) -> Response {
    let Download { name, bytes, file } = download;
    let (sender, receiver) = mpsc::channel::<io::Result<Bytes>>(2);
    tokio::spawn(async move {
        let mut source = file.take(bytes);
        loop {
            // No thread waits for a slow client.
            let read = spawn_blocking(move || read(source)).await;
            let Ok((piece, rest)) = read else { return };
            source = rest;
            let last = match &piece {
                Ok(piece) if piece.is_empty() && source.limit() == 0 => return,
                Ok(piece) => piece.is_empty(),
                Err(_) => true,
            };
            let piece = if piece.as_ref().is_ok_and(Bytes::is_empty) {
                // It became shorter: what was announced cannot be sent.
                Err(io::ErrorKind::UnexpectedEof.into())
            } else {
                piece
            };
            if sender.send(piece).await.is_err() || last {
                return;
            }
        }
    });
    let mut response = Body::from_stream(ReceiverStream::new(receiver)).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(bytes));
    let kind = HeaderValue::from_static("application/octet-stream");
    headers.insert(header::CONTENT_TYPE, kind);
    if let Ok(value) = HeaderValue::from_str(&disposition(&name)) {
        headers.insert(header::CONTENT_DISPOSITION, value);
    }
    response
}

fn read(mut source: io::Take<File>) -> (io::Result<Bytes>, io::Take<File>) {
    let mut piece = vec![0; PIECE];
    let read = source.read(&mut piece).map(|length| {
        piece.truncate(length);
        Bytes::from(piece)
    });
    (read, source)
}

/// The name in the form of RFC 8187, so that it can hold what it likes.
fn disposition(name: &str) -> String {
    let mut text = String::from("attachment; filename*=UTF-8''");
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            text.push(byte.into());
        } else {
            let _ = write!(text, "%{byte:02X}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out_of_the_header() {
        assert_eq!(disposition("O1.nc"), "attachment; filename*=UTF-8''O1.nc");
        assert_eq!(
            disposition("a\"\r\nx: ä"),
            "attachment; filename*=UTF-8''a%22%0D%0Ax%3A%20%C3%A4"
        );
    }
}
