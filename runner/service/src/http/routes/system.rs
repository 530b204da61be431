//! The gateway itself: who asks, how it is, what happens.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::{Extension, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::{Deserialize, Serialize};
use tokio::sync::broadcast::error::TryRecvError;
use utoipa::{IntoParams, ToSchema};

use super::super::access::Admin;
use super::super::extract::Filter;
use super::super::limits::GATHER_CHANGES;
use super::super::problem::{Problem, Refused};
use super::super::stream::{self, Polled, Stream, Telling};
use super::super::tokens::Role;
use super::{Answer, At, within_limit};
use crate::view::{Change, HealthView, JournalEntry, JournalFilter, ReadyView, ReloadView};
use crate::{Gateway, metrics};

/// Who asks.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct MeView {
    /// What the token allows.
    pub role: Role,
}

/// What the token allows
#[utoipa::path(get, operation_id = "gateway_me", path = "/me",
    tag = "gateway",
    responses((status = OK, body = MeView), Refused))]
pub(super) async fn me(Extension(role): Extension<Role>) -> Json<MeView> {
    Json(MeView { role })
}

/// How the gateway is
#[utoipa::path(get, operation_id = "gateway_health", path = "/health",
    tag = "gateway",
    responses((status = OK, body = HealthView), Refused))]
pub(super) async fn health(State(app): At) -> Answer<Json<HealthView>> {
    app.ask(|gateway| Ok(gateway.health())).await.map(Json)
}

/// The journal, the newest first
#[utoipa::path(get, operation_id = "gateway_journal", path = "/journal",
    tag = "gateway", params(JournalFilter),
    responses((status = OK, body = Vec<JournalEntry>), Refused))]
pub(super) async fn journal(
    State(app): At,
    Filter(filter): Filter<JournalFilter>,
) -> Answer<Json<Vec<JournalEntry>>> {
    within_limit(filter.limit)?;
    app.look(move |gateway| gateway.journal(&filter)).await.map(Json)
}

/// How changes are told.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub(super) struct EventsWish {
    /// As many milliseconds at least from one event to the next, 10,000 at most: of each link and
    /// each job only the newest is told then. Who shows hundreds of links asks for a second.
    #[param(format = "uint32", maximum = 10_000)]
    apart_ms: Option<u32>,
}

/// From one event of changes to the next, at most.
const MOST_APART_MS: u32 = 10_000;

/// All that changes from now on
///
/// Server-sent events: `changes` with a list of changes; `missed` with their number if the client was
/// too slow for some.
#[utoipa::path(get, operation_id = "gateway_events", path = "/events",
    tag = "gateway", params(EventsWish),
    responses((status = OK, body = Vec<Change>, content_type = "text/event-stream"), Refused))]
pub(super) async fn events(State(app): At, Filter(wish): Filter<EventsWish>) -> Answer<Stream> {
    let apart_ms = wish.apart_ms.unwrap_or(0);
    if apart_ms > MOST_APART_MS {
        let sentence = format!("changes are told at most {MOST_APART_MS} ms apart");
        let problem = Problem::new(StatusCode::UNPROCESSABLE_ENTITY, sentence);
        return Err(problem.of_field("apart_ms"));
    }
    let apart = Duration::from_millis(apart_ms.into());
    let slot = app.stream_slot()?;
    let mut changes = app.gateway.subscribe();
    let source = move || match changes.try_recv() {
        Ok(change) => Polled::News(Arc::unwrap_or_clone(change)),
        Err(TryRecvError::Lagged(count)) => Polled::Missed(count),
        Err(TryRecvError::Empty) => Polled::Nothing,
        Err(TryRecvError::Closed) => Polled::End,
    };
    let telling = Telling { name: "changes", gather: GATHER_CHANGES, apart, thin: newest };
    Ok(stream::of(source, telling, app.stopping.clone(), slot))
}

/// Of each link and each job only the newest view.
fn newest(mut changes: Vec<Change>) -> Vec<Change> {
    let (mut links, mut jobs) = (HashSet::new(), HashSet::new());
    let mut kept = Vec::with_capacity(changes.len());
    while let Some(change) = changes.pop() {
        let is_new = match &change {
            Change::Link(link) => links.insert(link.name.clone()),
            Change::LinkRemoved { name } => links.insert(name.clone()),
            Change::Job(job) => jobs.insert(job.id),
            _ => true,
        };
        if is_new {
            kept.push(change);
        }
    }
    kept.reverse();
    kept
}

/// Read the configuration again and apply what changed in it
///
/// Does not touch other links. An admin's.
#[utoipa::path(post, operation_id = "gateway_reload", path = "/reload",
    tag = "gateway",
    responses((status = OK, body = ReloadView), Refused))]
pub(super) async fn reload(_: Admin, State(app): At) -> Answer<Json<ReloadView>> {
    app.ask(Gateway::reload).await.map(Json)
}

/// Whether the gateway is alive; for whoever restarts it, so without a token.
pub(super) async fn healthz(State(app): At) -> Answer<Response> {
    let HealthView { is_healthy, .. } = app.ask(|gateway| Ok(gateway.health())).await?;
    Ok(plainly(is_healthy, if is_healthy { "healthy\n" } else { "not healthy\n" }))
}

/// Whether the gateway takes work; for whoever waits for it, so without a token.
pub(super) async fn readyz(State(app): At) -> Answer<Response> {
    let ReadyView { is_ready, .. } = app.ask(|gateway| Ok(gateway.ready())).await?;
    Ok(plainly(is_ready, if is_ready { "ready\n" } else { "not ready\n" }))
}

fn plainly(well: bool, text: &'static str) -> Response {
    let status = if well { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, text).into_response()
}

/// Metrics as Prometheus reads them.
pub(super) async fn metrics(State(app): At) -> Answer<Response> {
    let seen = app.ask(|gateway| Ok((gateway.health(), gateway.links()?, gateway.buses()?)));
    let (health, links, buses) = seen.await?;
    let http =
        metrics::HttpFigures { tally: &app.access.tally, connections: app.access.connections() };
    let text = metrics::text(&health, &links, &buses, http).map_err(|_| Problem::ours())?;
    let mut response = text.into_response();
    let kind = HeaderValue::from_static(metrics::CONTENT_TYPE);
    response.headers_mut().insert(header::CONTENT_TYPE, kind);
    Ok(response)
}
