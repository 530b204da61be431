//! Parts of a request, checked: what cannot be read becomes a problem.

use axum::body::{self, Body};
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use serde::de::DeserializeOwned;
use tokio::time::timeout;

use super::limits::{DOCUMENT_BYTES, DOCUMENT_PATIENCE};
use super::problem::Problem;

/// The variable parts of the path.
#[derive(Debug)]
pub(super) struct Segments<T>(pub(super) T);

impl<T, S> FromRequestParts<S> for Segments<T>
where
    T: DeserializeOwned + Send,
    S: Send + Sync,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match Path::from_request_parts(parts, state).await {
            Ok(Path(value)) => Ok(Self(value)),
            Err(rejection) => Err(Problem::bad(rejection.body_text())),
        }
    }
}

/// The part after the question mark.
#[derive(Debug)]
pub(super) struct Filter<T>(pub(super) T);

impl<T, S> FromRequestParts<S> for Filter<T>
where
    T: DeserializeOwned,
    S: Send + Sync,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match Query::from_request_parts(parts, state).await {
            Ok(Query(value)) => Ok(Self(value)),
            Err(rejection) => Err(Problem::bad(rejection.body_text())),
        }
    }
}

/// A JSON document: of a bounded size, and here in good time.
#[derive(Debug)]
pub(super) struct Document<T>(pub(super) T);

impl<T: DeserializeOwned, S: Sync> FromRequest<S> for Document<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &S) -> Result<Self, Problem> {
        if !is_json(&request) {
            return Err(Problem::new(
                StatusCode::UNSUPPORTED_MEDIA_TYPE,
                "a JSON document is needed, with `Content-Type: application/json`",
            ));
        }
        let bytes = document(request.into_body()).await?;
        // A list in the order of the fields would do for serde.
        if bytes.trim_ascii_start().first() != Some(&b'{') {
            return Err(Problem::bad("a JSON object is needed"));
        }
        let mut reader = serde_json::Deserializer::from_slice(&bytes);
        match T::deserialize(&mut reader).and_then(|value| reader.end().map(|()| value)) {
            Ok(value) => Ok(Self(value)),
            Err(error) => Err(Problem::bad(format!("the document is not right: {error}"))),
        }
    }
}

fn is_json(request: &Request) -> bool {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    let kind = kind.and_then(|kind| kind.split(';').next()).unwrap_or_default();
    kind.trim().eq_ignore_ascii_case("application/json")
}

async fn document(body: Body) -> Result<body::Bytes, Problem> {
    match timeout(DOCUMENT_PATIENCE, body::to_bytes(body, DOCUMENT_BYTES)).await {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(_)) => Err(Problem::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            format!("the document broke off, or has more than {DOCUMENT_BYTES} bytes"),
        )),
        Err(_) => {
            Err(Problem::new(StatusCode::REQUEST_TIMEOUT, "the document did not come in time"))
        }
    }
}
