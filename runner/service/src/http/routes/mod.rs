//! What can be asked for, and the document that says so.

mod buses;
mod cells;
mod download;
mod jobs;
mod library;
mod links;
mod pages;
mod programs;
mod system;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use axum::extract::State;
use axum::http::StatusCode;
use axum::middleware::from_fn_with_state;
use axum::routing::get;
use axum::{Json, Router};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::spawn_blocking;
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa::{Modify, OpenApi, ToSchema as _};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

pub use system::MeView;

use super::access::{self, AccessControl};
use super::limits::{CHECKS, FEEDS, LOOKS, STREAMS, UPLOADS};
use super::problem::Problem;
use super::server::RouteParts;
use crate::config::http::Limits;
use crate::{Gateway, Refusal};

/// What every handler can reach.
pub(super) struct AppState {
    pub(super) gateway: Gateway,
    pub(super) access: Arc<AccessControl>,
    pub(super) limits: Limits,
    pub(super) stopping: watch::Receiver<bool>,
    looks: Arc<Semaphore>,
    checks: Arc<Semaphore>,
    uploads: Arc<Semaphore>,
    feeds: Arc<Semaphore>,
    streams: Arc<Semaphore>,
}

/// [`AppState`] as a handler takes it.
pub(super) type At = State<Arc<AppState>>;

/// What a handler that may refuse gives.
pub(super) type Answer<T> = Result<T, Problem>;

impl AppState {
    /// Asks the gateway, on a thread that may block.
    pub(super) async fn ask<T: Send + 'static>(
        &self,
        question: impl FnOnce(&Gateway) -> Result<T, Refusal> + Send + 'static,
    ) -> Answer<T> {
        let gateway = self.gateway.clone();
        match spawn_blocking(move || question(&gateway)).await {
            Ok(answer) => answer.map_err(Problem::from),
            Err(_) => Err(Problem::ours()),
        }
    }

    /// Asks for a list, which takes longer: a few at a time, so that whoever asks for many has no
    /// more of the processors than that.
    pub(super) async fn look<T: Send + 'static>(
        &self,
        question: impl FnOnce(&Gateway) -> Result<T, Refusal> + Send + 'static,
    ) -> Answer<T> {
        // It is never closed.
        let _turn = self.looks.acquire().await.map_err(|_| Problem::ours())?;
        self.ask(question).await
    }

    /// Asks for what computes for seconds: a few at a time, and only as long as somebody waits for
    /// the answer.
    pub(super) async fn compute<T: Send + 'static>(
        &self,
        question: impl FnOnce(&Gateway, &Arc<AtomicBool>) -> Result<T, Refusal> + Send + 'static,
    ) -> Answer<T> {
        // It is never closed.
        let turn = self.checks.clone().acquire_owned().await.map_err(|_| Problem::ours())?;
        let waiting = Waiting::default();
        let stop = Arc::clone(&waiting.0);
        self.ask(move |gateway| {
            // Its turn ends when it has, also if nobody waits any more.
            let _turn = turn;
            question(gateway, &stop)
        })
        .await
    }

    fn a_slot(slots: &Arc<Semaphore>, what: &str) -> Answer<OwnedSemaphorePermit> {
        slots.clone().try_acquire_owned().map_err(|_| {
            Problem::unavailable(format!("there are too many {what} at present; try again later"))
        })
    }

    pub(super) fn upload_slot(&self) -> Answer<OwnedSemaphorePermit> {
        Self::a_slot(&self.uploads, "uploads")
    }

    pub(super) fn feed_slot(&self) -> Answer<OwnedSemaphorePermit> {
        Self::a_slot(&self.feeds, "feeds")
    }

    pub(super) fn stream_slot(&self) -> Answer<OwnedSemaphorePermit> {
        Self::a_slot(&self.streams, "streams")
    }
}

/// Whoever waits for an answer; what computes it is stopped when it is gone.
#[derive(Default)]
struct Waiting(Arc<AtomicBool>);

impl Drop for Waiting {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "Softplug gateway",
        description = "Serial links of machines: jobs, programs, plug-ins and what happens. \
            Every refusal is a problem document (RFC 9457).",
    ),
    modifiers(&Bearer),
    security(("token" = [])),
    tags(
        (name = "links", description = "Machines' lines with their plug-ins"),
        (name = "jobs", description = "What is sent, read or written"),
        (name = "programs", description = "What can be sent"),
        (name = "receptions", description = "What was received"),
        (name = "plug-ins", description = "The library, and swapping"),
        (name = "buses", description = "What feeds front-end units"),
        (name = "cells", description = "Links that work together"),
        (name = "gateway", description = "The gateway itself"),
    )
)]
struct Document;

struct Bearer;

impl Modify for Bearer {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let scheme = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        document.components.get_or_insert_default().add_security_scheme("token", scheme);
        // Named by the answers of all operations, which are not read for schemas.
        let schema = <Problem as utoipa::PartialSchema>::schema();
        let components = document.components.get_or_insert_default();
        components.schemas.insert(Problem::name().into_owned(), schema);
    }
}

fn known_only() -> OpenApiRouter<Arc<AppState>> {
    OpenApiRouter::new()
        .routes(routes!(links::list))
        .routes(routes!(links::show))
        .routes(routes!(links::kinds))
        .routes(routes!(links::lathe))
        .routes(routes!(links::history))
        .routes(routes!(jobs::check))
        .routes(routes!(links::reopen))
        .routes(routes!(links::force_resume))
        .routes(routes!(links::quarantine))
        .routes(routes!(links::release))
        .routes(routes!(links::swap))
        .routes(routes!(links::watch))
        .routes(routes!(jobs::submit))
        .routes(routes!(jobs::feed))
        .routes(routes!(jobs::list))
        .routes(routes!(jobs::show))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(jobs::abort))
        .routes(routes!(jobs::restart))
        .routes(routes!(jobs::acknowledge))
        .routes(routes!(jobs::prioritise))
        .routes(routes!(programs::list))
        .routes(routes!(programs::download, programs::upload, programs::delete))
        .routes(routes!(programs::receptions))
        .routes(routes!(programs::download_reception, programs::delete_reception))
        .routes(routes!(programs::download_trace))
        .routes(routes!(library::list, library::add))
        .routes(routes!(library::remove))
        .routes(routes!(library::collect_garbage))
        .routes(routes!(buses::list))
        .routes(routes!(cells::list))
        .routes(routes!(cells::show))
        .routes(routes!(cells::force))
        .routes(routes!(cells::release))
        .routes(routes!(cells::mode))
        .routes(routes!(cells::clear))
        .routes(routes!(system::me))
        .routes(routes!(system::health))
        .routes(routes!(system::journal))
        .routes(routes!(system::events))
        .routes(routes!(system::reload))
}

/// The routes that stand in the API's document.
fn described() -> OpenApiRouter<Arc<AppState>> {
    OpenApiRouter::with_openapi(Document::openapi()).nest("/api/v1", known_only())
}

/// All routes.
pub(super) fn all(gateway: Gateway, limits: Limits, surroundings: RouteParts) -> Router {
    let RouteParts { access, stopping } = surroundings;
    let app = Arc::new(AppState {
        gateway,
        access: access.clone(),
        limits,
        stopping,
        looks: Arc::new(Semaphore::new(LOOKS)),
        checks: Arc::new(Semaphore::new(CHECKS)),
        uploads: Arc::new(Semaphore::new(UPLOADS)),
        feeds: Arc::new(Semaphore::new(FEEDS)),
        streams: Arc::new(Semaphore::new(STREAMS)),
    });
    let (api, document) = described().split_for_parts();
    let document = Arc::new(document);
    let with_token = api
        .route("/metrics", get(system::metrics))
        .route_layer(from_fn_with_state(access.clone(), access::known));
    Router::new()
        .route("/api/v1/openapi.json", get(move || async move { Json(document.as_ref().clone()) }))
        .route("/healthz", get(system::healthz))
        .route("/readyz", get(system::readyz))
        .merge(pages::routes())
        .merge(with_token)
        .fallback(nothing_here)
        .method_not_allowed_fallback(no_such_method)
        .layer(from_fn_with_state(access, access::pass))
        .with_state(app)
}

/// A list has at most this many entries.
const MOST_LISTED: u32 = 1000;

fn within_limit(limit: Option<u32>) -> Answer<()> {
    match limit {
        Some(limit) if limit > MOST_LISTED => {
            let sentence = format!("at most {MOST_LISTED} are listed at a time; `before` goes on");
            Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, sentence).of_field("limit"))
        }
        _ => Ok(()),
    }
}

async fn nothing_here() -> Problem {
    Problem::new(StatusCode::NOT_FOUND, "there is nothing at this path; see /api/v1/openapi.json")
}

async fn no_such_method() -> Problem {
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "this path does not take this method")
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use serde_json::Value;

    use super::*;

    fn document() -> Value {
        serde_json::to_value(described().into_openapi()).unwrap()
    }

    fn references(value: &Value, found: &mut HashSet<String>) {
        match value {
            Value::Object(fields) => {
                if let Some(Value::String(to)) = fields.get("$ref") {
                    found.insert(to.clone());
                }
                fields.values().for_each(|value| references(value, found));
            }
            Value::Array(values) => values.iter().for_each(|value| references(value, found)),
            _ => {}
        }
    }

    #[test]
    fn the_document_is_closed_in_itself() {
        let document = document();
        let mut found = HashSet::new();
        references(&document, &mut found);
        assert!(found.len() > 20, "{found:?}");
        for to in found {
            let pointer = to.strip_prefix('#').unwrap();
            assert!(document.pointer(pointer).is_some(), "{to}");
        }
    }

    #[test]
    fn every_operation_is_named_described_and_may_be_refused() {
        let document = document();
        assert_eq!(document["security"][0]["token"], Value::Array(Vec::new()));
        let mut names = HashSet::new();
        let mut count = 0;
        for (path, item) in document["paths"].as_object().unwrap() {
            assert!(path.starts_with("/api/v1/"), "{path}");
            for (method, operation) in item.as_object().unwrap() {
                let name = operation["operationId"].as_str().unwrap();
                assert!(names.insert(name.to_owned()), "{method} {path}: {name} is there twice");
                assert!(!operation["summary"].as_str().unwrap().is_empty(), "{path}");
                for status in ["401", "404", "429", "503"] {
                    let answer = &operation["responses"][status]["content"];
                    assert!(answer["application/problem+json"].is_object(), "{path} {status}");
                }
                count += 1;
            }
        }
        assert_eq!(count, 46);
    }
}
