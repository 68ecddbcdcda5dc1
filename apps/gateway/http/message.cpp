// SPDX-License-Identifier: BSL-1.0
#include "gateway/http/message.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include <algorithm>
#include <cstdint>
#include <optional>

namespace gateway {
namespace {

using cles::errc;

// No page of another origin may frame or embed what is served, and nothing keeps a copy of it.
constexpr std::string_view common_fields =
    "Cache-Control: no-store\r\n"
    "X-Content-Type-Options: nosniff\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'\r\n";

struct reason {
    int status;
    std::string_view text;
    errc code; // of a refusal of the gateway
};
constexpr std::array reasons{reason{200, "OK", errc::failed},
                             reason{204, "No Content", errc::failed},
                             reason{400, "Bad Request", errc::bad_request},
                             reason{401, "Unauthorized", errc::denied},
                             reason{403, "Forbidden", errc::denied},
                             reason{404, "Not Found", errc::no_target},
                             reason{405, "Method Not Allowed", errc::bad_request},
                             reason{411, "Length Required", errc::bad_request},
                             reason{413, "Content Too Large", errc::too_large},
                             reason{415, "Unsupported Media Type", errc::bad_request},
                             reason{421, "Misdirected Request", errc::denied},
                             reason{431, "Request Header Fields Too Large", errc::too_large},
                             reason{499, "Client Closed Request", errc::cancelled},
                             reason{500, "Internal Server Error", errc::failed},
                             reason{502, "Bad Gateway", errc::unavailable},
                             reason{503, "Service Unavailable", errc::busy},
                             reason{504, "Gateway Timeout", errc::deadline},
                             reason{505, "HTTP Version Not Supported", errc::bad_request}};

const reason& reason_of(int status) noexcept {
    static constexpr reason other{500, "Error", errc::failed};
    const auto* const found = std::ranges::find(reasons, status, &reason::status);
    return found == reasons.end() ? other : *found;
}

std::string head_text(int status, const header_fields& fields) {
    auto out = "HTTP/1.1 " + std::to_string(status) + " " + std::string{reason_of(status).text} + "\r\n";
    out.append(common_fields);
    for (const auto& [name, value] : fields) {
        out.append(name).append(": ").append(value).append("\r\n");
    }
    return out;
}

// The seconds after which a request that is busy may be repeated; empty if the failure names no time, or says that the
// request has run.
std::string retry_after(std::string_view failure) {
    cles::json_reader r{failure};
    std::string_view key;
    std::optional<std::uint64_t> ms;
    bool ran = false;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        good = key == "retry_ms" ? r.read(ms.emplace()) : key == "ran" ? r.read(ran) : r.skip();
    }
    constexpr std::uint64_t per_second = 1000;
    return good && !ran && ms ? std::to_string(std::max<std::uint64_t>((*ms + per_second - 1) / per_second, 1))
                              : std::string{};
}

} // namespace

std::string_view http_request::field(std::string_view name) const noexcept {
    const auto found = std::ranges::find_if(fields, [name](const auto& each) { return each.first == name; });
    return found == fields.end() ? std::string_view{} : std::string_view{found->second};
}

std::size_t http_request::count(std::string_view name) const noexcept {
    return static_cast<std::size_t>(
        std::ranges::count_if(fields, [name](const auto& each) { return each.first == name; }));
}

http_response response_of(const refusal& why) {
    return {.status = why.status, .body = failure_text(reason_of(why.status).code, why.message), .fields = why.fields};
}

http_response response_to_failure(boost::system::error_code code, std::string_view message, std::string_view failure,
                                  header_fields fields) {
    const auto told = told_code(code);
    const auto* const found = std::ranges::find(statuses, told, &coded_status::code);
    http_response made{.status = found == statuses.end() ? 500 : found->status,
                       .body = failure.empty() ? failure_text(told, message) : std::string{failure},
                       .fields = std::move(fields)};
    if (auto after = told == errc::busy ? retry_after(made.body) : std::string{}; !after.empty()) {
        made.fields.emplace_back("Retry-After", std::move(after));
    }
    return made;
}

std::string to_text(const http_response& response, bool keep_alive, bool has_body) {
    auto out = head_text(response.status, response.fields);
    out.append(keep_alive ? "" : "Connection: close\r\n");
    if (response.status == 204) { // has no content
        return out + "\r\n";
    }
    out.append("Content-Type: ").append(response.type).append("\r\nContent-Length: ");
    out.append(std::to_string(response.body.size() + response.permanent.size())).append("\r\n\r\n");
    if (has_body) {
        out.append(response.body);
    }
    return out;
}

std::string event_stream_head(const header_fields& fields) {
    return head_text(200, fields) +
           "Connection: close\r\nContent-Type: text/event-stream\r\nX-Accel-Buffering: no\r\n\r\n";
}

errc told_code(boost::system::error_code failure) noexcept {
    if (failure.category() != cles::error_category()) {
        return errc::unavailable; // no link: what the system says is in the message
    }
    const auto code = static_cast<errc>(failure.value());
    switch (code) {
    case errc::conversion:
    case errc::invalid_url:
    case errc::unknown_scheme:
    case errc::invalid_name:
    case errc::invalid_option: return errc::bad_request;
    case errc::stopped:
    case errc::closed: return errc::unavailable;
    default: return cles::errc_from_wire(cles::wire_name(code));
    }
}

std::string failure_text(errc code, std::string_view message) {
    return R"({"error":")" + std::string{cles::wire_name(code)} + R"(","message":)" + json_string(message) + "}";
}

std::string json_string(std::string_view text) {
    std::string out;
    cles::json_writer{out}.value(text);
    return out;
}

std::string small_letters(std::string_view text) {
    std::string out{text};
    std::ranges::transform(out, out.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
    return out;
}

std::string_view trimmed(std::string_view text) noexcept {
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    return text.substr(0, text.find_last_not_of(" \t") + 1);
}

std::string_view take_part(std::string_view& list, char separator) noexcept {
    const auto part = list.substr(0, list.find(separator));
    list.remove_prefix(std::min(part.size() + 1, list.size()));
    return trimmed(part);
}

} // namespace gateway
