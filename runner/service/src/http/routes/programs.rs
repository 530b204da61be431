//! Programs, and what was received.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::Response;
use serde::Deserialize;
use utoipa::IntoParams;

use super::super::access::Admin;
use super::super::extract::{Filter, Segments};
use super::super::limits::UPLOAD_PACE;
use super::super::problem::Refused;
use super::super::upload;
use super::{Answer, At, download};
use crate::Gateway;
use crate::view::{ProgramView, ReceptionView};

/// All programs
#[utoipa::path(get, operation_id = "program_list", path = "/programs",
    tag = "programs",
    responses((status = OK, body = Vec<ProgramView>), Refused))]
pub(super) async fn list(State(app): At) -> Answer<Json<Vec<ProgramView>>> {
    app.look(Gateway::programs).await.map(Json)
}

/// A program's bytes
#[utoipa::path(get, operation_id = "program_download", path = "/programs/{name}",
    tag = "programs",
    params(("name" = String, Path, description = "Name of the program; a slash in it as %2F")),
    responses((status = OK, body = Vec<u8>, content_type = "application/octet-stream"), Refused))]
pub(super) async fn download(State(app): At, Segments(name): Segments<String>) -> Answer<Response> {
    app.ask(move |gateway| gateway.download(&name)).await.map(download::answer)
}

/// What to do about a program that is there.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub(super) struct Overwrite {
    /// Whether it is replaced; refused if nothing is said.
    overwrite: bool,
}

/// Store a program: all of the body, or nothing
#[utoipa::path(put, operation_id = "program_upload", path = "/programs/{name}",
    tag = "programs",
    params(
        ("name" = String, Path, description = "Name of the program; a slash in it as %2F"),
        Overwrite,
    ),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = CREATED, body = ProgramView), Refused))]
pub(super) async fn upload(
    State(app): At,
    Segments(name): Segments<String>,
    Filter(Overwrite { overwrite }): Filter<Overwrite>,
    body: Body,
) -> Answer<(StatusCode, Json<ProgramView>)> {
    let _slot = app.upload_slot()?;
    let gateway = app.gateway.clone();
    let most = app.limits.upload_bytes;
    let stored = upload::receive(body, UPLOAD_PACE, most, move |body| {
        Ok(gateway.upload(&name, overwrite, body)?)
    });
    Ok((StatusCode::CREATED, Json(stored.await?)))
}

/// Delete a program
///
/// Jobs that send it have a copy. An admin's.
#[utoipa::path(delete, operation_id = "program_delete", path = "/programs/{name}",
    tag = "programs",
    params(("name" = String, Path, description = "Name of the program; a slash in it as %2F")),
    responses((status = NO_CONTENT), Refused))]
pub(super) async fn delete(
    _: Admin,
    State(app): At,
    Segments(name): Segments<String>,
) -> Answer<StatusCode> {
    app.ask(move |gateway| gateway.delete(&name)).await.map(|()| StatusCode::NO_CONTENT)
}

/// What a link has received, the newest first
#[utoipa::path(get, operation_id = "program_receptions", path = "/links/{link}/receptions",
    tag = "receptions",
    params(("link" = String, Path, description = "Name of the link")),
    responses((status = OK, body = Vec<ReceptionView>), Refused))]
pub(super) async fn receptions(
    State(app): At,
    Segments(link): Segments<String>,
) -> Answer<Json<Vec<ReceptionView>>> {
    app.look(move |gateway| gateway.receptions(&link)).await.map(Json)
}

/// The bytes of something that was received
#[utoipa::path(get, operation_id = "program_download_reception", path = "/links/{link}/receptions/{file}",
    tag = "receptions",
    params(
        ("link" = String, Path, description = "Name of the link"),
        ("file" = String, Path, description = "Name of the file"),
    ),
    responses((status = OK, body = Vec<u8>, content_type = "application/octet-stream"), Refused))]
pub(super) async fn download_reception(
    State(app): At,
    Segments((link, file)): Segments<(String, String)>,
) -> Answer<Response> {
    app.ask(move |gateway| gateway.download_reception(&link, &file)).await.map(download::answer)
}

/// Delete something that was received
///
/// An admin's.
#[utoipa::path(delete, operation_id = "program_delete_reception", path = "/links/{link}/receptions/{file}",
    tag = "receptions",
    params(
        ("link" = String, Path, description = "Name of the link"),
        ("file" = String, Path, description = "Name of the file"),
    ),
    responses((status = NO_CONTENT), Refused))]
pub(super) async fn delete_reception(
    _: Admin,
    State(app): At,
    Segments((link, file)): Segments<(String, String)>,
) -> Answer<StatusCode> {
    let deleted = app.ask(move |gateway| gateway.delete_reception(&link, &file)).await;
    deleted.map(|()| StatusCode::NO_CONTENT)
}

/// The trace that led to a fault, for `softplug replay`
#[utoipa::path(get, operation_id = "program_download_trace", path = "/links/{link}/traces/{file}",
    tag = "plug-ins",
    params(
        ("link" = String, Path, description = "Name of the link"),
        ("file" = String, Path, description = "Name of the file"),
    ),
    responses((status = OK, body = Vec<u8>, content_type = "application/octet-stream"), Refused))]
pub(super) async fn download_trace(
    State(app): At,
    Segments((link, file)): Segments<(String, String)>,
) -> Answer<Response> {
    app.ask(move |gateway| gateway.download_trace(&link, &file)).await.map(download::answer)
}
