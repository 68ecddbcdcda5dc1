// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/handler.hpp"

#include "gateway/serve/assets.hpp"

#include <chrono>
#include <string_view>

namespace gateway {

// Strangers must not fill the log.
refusal handler::denied(refusal why) {
    ++counts_.denied;
    constexpr std::chrono::seconds pause{1};
    if (const auto now = std::chrono::steady_clock::now(); now - logged_ >= pause) {
        logged_ = now;
        log_("a request was refused: " + why.message);
    }
    return why;
}

http_response handler::refused(const refusal& why, const http_request& head) const {
    auto made = response_of(why);
    const auto more = cors_fields(settings_.origins, head);
    made.fields.insert(made.fields.end(), more.begin(), more.end());
    return made;
}

std::variant<asked, refusal> handler::decide(const http_request& head) {
    auto found = route_of(head.method, head.target);
    auto* const where = std::get_if<route>(&found);
    const bool is_page = where != nullptr && where->to == place::page;
    if (auto why = origin_refusal(settings_.origins, head, is_page)) {
        return denied(std::move(*why));
    }
    if (where == nullptr) {
        return std::get<refusal>(std::move(found));
    }
    asked made{.where = std::move(*where), .who = {}, .fields = cors_fields(settings_.origins, head)};
    if (is_page) { // where the token is entered
        return made;
    }
    const auto now = std::chrono::steady_clock::now();
    auto admitted = door_.admit(credentials_in(head), now);
    if (auto* const why = std::get_if<refusal>(&admitted)) {
        return denied(std::move(*why));
    }
    made.who = std::get<caller>(std::move(admitted));
    made.is_admitted = [this, who = made.who] { return door_.is_admitted(who, std::chrono::steady_clock::now()); };
    made.is_secured = settings_.is_secured;
    return made;
}

std::optional<http_response> handler::response_to_head(const http_request& head) {
    if (head.method == "OPTIONS") {
        return preflight(settings_.origins, head);
    }
    const auto found = decide(head);
    const auto* const why = std::get_if<refusal>(&found);
    return why == nullptr ? std::nullopt : std::optional{refused(*why, head)};
}

std::shared_ptr<exchange> handler::begin(const http_request& request, const std::shared_ptr<response_sink>& to) {
    auto found = decide(request);
    if (const auto* const why = std::get_if<refusal>(&found)) { // the token may have ended meanwhile
        to->respond(refused(*why, request));
        return nullptr;
    }
    auto what = std::get<asked>(std::move(found));
    to->set_token(what.who.hash);
    switch (what.where.to) {
    case place::page: {
        if (const auto* const page = find_asset(what.where.path)) {
            to->respond({.type = std::string{page->type}, .fields = what.fields, .permanent = page->content});
        } else {
            to->respond(refused({.status = 404, .message = "there is no such page", .fields = {}}, request));
        }
        return nullptr;
    }
    case place::session: to->respond(session_response(request, what)); return nullptr;
    case place::metrics: return begin_metrics(node_, to, std::move(what), metrics_format_for(request.field("accept")));
    case place::openapi: return begin_openapi(node_, to, std::move(what), types_);
    case place::fleet: break;
    }
    return begin_in_fleet(request, to, std::move(what));
}

// The page exchanges its token for a cookie, which its scripts cannot read.
http_response handler::session_response(const http_request& request, const asked& what) {
    const bool is_encrypted = settings_.origins.is_tls || settings_.origins.is_behind_proxy;
    http_response made{.status = 204, .body = {}, .fields = what.fields};
    if (request.method == "DELETE") {
        door_.close_session(what.who, credentials_in(request).session); // also if it has a token beside the cookie
        made.fields.emplace_back("Set-Cookie", cookie_for({}, is_encrypted));
    } else if (request.method == "GET") {
        made.status = 200;
        made.body = R"({"node":)" + json_string(node_.name()) + R"(,"name":)" + json_string(what.who.name) +
                    R"(,"secured":)" + (settings_.is_secured ? "true}" : "false}");
    } else if (!what.who.hash.empty() && what.who.session.empty()) { // a session does not prolong itself
        auto id = random_text();
        made.fields.emplace_back("Set-Cookie", cookie_for(id, is_encrypted));
        door_.open_session(what.who, std::move(id), std::chrono::steady_clock::now());
    }
    return made;
}

std::shared_ptr<exchange> handler::begin_in_fleet(const http_request& request, const std::shared_ptr<response_sink>& to,
                                                  asked what) {
    const auto deadline = deadline_of(request);
    const auto body = body_of(request);
    const auto* why = std::get_if<refusal>(&deadline);
    why = why != nullptr ? why : std::get_if<refusal>(&body);
    const refusal no_body{.status = 400, .message = "GET takes no body", .fields = {}};
    why = request.method == "GET" && !request.body.empty() ? &no_body : why;
    if (why != nullptr) {
        to->respond(refused(*why, request));
        return nullptr;
    }
    const auto limit = std::get<std::chrono::milliseconds>(deadline);
    if (what.where.verb == cles::verb::bind) {
        return begin_binding(node_, to, std::move(what), limit, request.field("last-event-id"), counts_);
    }
    cles::call_options options;
    options.deadline(limit);
    const auto parent = parse_trace_parent(request.field("traceparent"));
    std::function<void(std::string_view)> ended;
    if (spans_) {
        auto begun = spans_->begin(parent, std::string{cles::to_string(what.where.verb)} + " " + what.where.noun);
        options.trace(to_text(begun.trace));
        ended = [spans = spans_, begun = std::move(begun)](std::string_view outcome) { spans->end(begun, outcome); };
    } else if (!parent.trace.empty()) {
        options.trace(to_text(parent));
    }
    const bool wants_events = what.where.verb == cles::verb::delegate &&
                              request.field("accept").find("text/event-stream") != std::string_view::npos;
    return begin_request(node_, to, std::move(what), options, std::get<std::string>(body), wants_events,
                         std::move(ended));
}

} // namespace gateway
