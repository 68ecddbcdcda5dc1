// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/span_exporter.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "gateway/access/tokens.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <utility>

namespace gateway {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using asio::ip::tcp;

namespace {

constexpr auto pause_between = 1s;
constexpr auto patience_with_node = 1s;
constexpr auto patience_with_collector = 5s;
constexpr std::size_t most_waiting = 4096;
constexpr std::size_t most_at_once = 1024;
constexpr std::size_t most_collections = 8; // in progress; of other requests, only the gateway's own span is told
constexpr std::size_t longest_status_line = 1024;
constexpr std::size_t most_asked = 32; // nodes of one trace

std::int64_t unix_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
}

/// A connection to the collector, and how long it may take. The timer may have ended when it is cancelled.
struct attempt {
    explicit attempt(const asio::any_io_executor& executor) : socket(executor), resolver(executor), limit(executor) {}
    tcp::socket socket;
    tcp::resolver resolver;
    asio::steady_timer limit;
};

std::string request_text(const collector_address& to, const std::string& document) {
    const auto host = to.host.find(':') == std::string::npos ? to.host : "[" + to.host + "]";
    return "POST " + to.path + " HTTP/1.1\r\nHost: " + host + ":" + to.port +
           "\r\nContent-Type: application/json\r\nConnection: close\r\nContent-Length: " +
           std::to_string(document.size()) + "\r\n\r\n" + document;
}

} // namespace

collector_address collector_at(const std::string& url) {
    constexpr std::string_view scheme = "http://";
    if (!url.starts_with(scheme)) {
        throw std::runtime_error("'" + url +
                                 "': write http://HOST:PORT, where a collector is on a network that is trusted");
    }
    const auto rest = url.substr(scheme.size());
    const auto slash = std::min(rest.find('/'), rest.size());
    const auto authority = rest.substr(0, slash);
    const auto bracket = authority.starts_with('[') ? authority.find(']') : std::size_t{0};
    const auto colon = bracket == std::string::npos ? std::string::npos : authority.find(':', bracket);
    auto host = authority.substr(0, colon);
    auto port = colon == std::string::npos ? std::string{"4318"} : authority.substr(colon + 1);
    if (host.starts_with('[') && host.ends_with(']')) {
        host = host.substr(1, host.size() - 2);
    }
    if (host.empty() || port.empty() || port.find_first_not_of("0123456789") != std::string::npos ||
        url.find_first_of(" \r\n") != std::string::npos) {
        throw std::runtime_error("'" + url + "' is not a URL such as http://127.0.0.1:4318");
    }
    const auto path = rest.substr(slash);
    return {.host = std::move(host), .port = std::move(port), .path = path.size() > 1 ? path : "/v1/traces"};
}

span_exporter::span_exporter(cles::service& node, collector_address where, gateway_counts& counts,
                             std::function<void(const std::string&)> log)
    : node_(&node), where_(std::move(where)), counts_(counts), log_(std::move(log)), timer_(node.get_executor()) {}

void span_exporter::start() { asio::co_spawn(node_->get_executor(), run(shared_from_this()), asio::detached); }

void span_exporter::stop() {
    node_ = nullptr;
    timer_.cancel();
}

span_exporter::begun span_exporter::begin(const trace_parent& parent, std::string name) const {
    const auto drawn = random_text(); // 64 hex digits
    begun made;
    made.trace.trace = parent.trace.empty() ? drawn.substr(0, 32) : parent.trace;
    made.trace.span = drawn.substr(48);
    made.trace.is_sampled = parent.trace.empty() || parent.is_sampled;
    made.span = {.node = node_ == nullptr ? std::string{} : node_->name(),
                 .id = made.trace.span,
                 .parent = parent.span,
                 .name = std::move(name),
                 .start_ns = unix_ns()};
    return made;
}

void span_exporter::add(const std::string& trace, placed_span span) {
    if (waiting_.size() >= most_waiting) {
        ++counts_.spans_dropped;
    } else {
        waiting_.push_back({.trace = trace, .span = std::move(span)});
    }
}

void span_exporter::end(begun what, std::string_view outcome) {
    if (!what.trace.is_sampled || node_ == nullptr) {
        return;
    }
    what.span.end_ns = std::max(unix_ns(), what.span.start_ns);
    what.span.outcome = outcome;
    add(what.trace.trace, what.span);
    if (collecting_ < most_collections) {
        ++collecting_;
        asio::co_spawn(node_->get_executor(), collect(shared_from_this(), std::make_shared<begun>(std::move(what))),
                       asio::detached);
    }
}

// First this node, then those to which it has sent requests, and so on.
asio::awaitable<void> span_exporter::collect(std::shared_ptr<span_exporter> self, std::shared_ptr<begun> what) {
    std::vector<tool::trace_document> documents;
    std::vector<std::string> names{"self"};
    cles::call_options options;
    options.deadline(patience_with_node);
    for (std::size_t i = 0; i < names.size() && self->node_ != nullptr; ++i) {
        const auto noun = names[i] + ":cles/trace/" + what->trace.trace;
        if (names[i] == self->node_->name()) {
            continue; // asked as self
        }
        try {
            const cles::json_text reply = co_await self->node_->async_pull(noun, options);
            documents.push_back(read_trace(reply.text));
            add_nodes(documents.back(), names, most_asked);
        } catch (const cles::error&) { // it may not be asked, or is gone
            continue;
        }
    }
    for (auto& span : place_spans(what->span, documents)) {
        self->add(what->trace.trace, std::move(span));
    }
    --self->collecting_;
}

asio::awaitable<void> span_exporter::run(std::shared_ptr<span_exporter> self) {
    while (self->node_ != nullptr) {
        self->timer_.expires_after(pause_between);
        try {
            co_await self->timer_.async_wait(asio::use_awaitable);
        } catch (const boost::system::system_error&) {
            co_return;
        }
        while (!self->waiting_.empty() && self->node_ != nullptr) {
            const auto count = std::min(self->waiting_.size(), most_at_once);
            const auto end = self->waiting_.begin() + static_cast<std::ptrdiff_t>(count);
            const std::vector<traced_span> batch(self->waiting_.begin(), end);
            self->waiting_.erase(self->waiting_.begin(), end);
            co_await self->send(otlp_document(batch), count);
        }
    }
}

asio::awaitable<void> span_exporter::send(std::string document, std::size_t count) {
    const auto made = std::make_shared<attempt>(timer_.get_executor());
    made->limit.expires_after(patience_with_collector);
    made->limit.async_wait([made](boost::system::error_code code) {
        if (!code) {
            boost::system::error_code ignored;
            made->resolver.cancel();
            made->socket.close(ignored);
        }
    });
    const auto text = request_text(where_, document);
    std::string reply;
    std::string why;
    try {
        const auto found = co_await made->resolver.async_resolve(where_.host, where_.port, asio::use_awaitable);
        co_await asio::async_connect(made->socket, found, asio::use_awaitable);
        co_await asio::async_write(made->socket, asio::buffer(text), asio::use_awaitable);
        auto line = asio::dynamic_buffer(reply, longest_status_line);
        co_await asio::async_read_until(made->socket, line, '\n', asio::use_awaitable);
        const auto status = std::string_view{reply}.substr(0, reply.find('\r'));
        const auto code = status.substr(std::min(status.find(' ') + 1, status.size()));
        why = code.starts_with('2') ? std::string{} : "it replies " + std::string{status};
    } catch (const boost::system::system_error& e) {
        why = e.code().message();
    }
    made->limit.cancel();
    (why.empty() ? counts_.spans_sent : counts_.spans_dropped) += count;
    const auto now = std::chrono::steady_clock::now();
    if (!why.empty() && (logged_ == std::chrono::steady_clock::time_point{} || now - logged_ > 1min)) {
        logged_ = now;
        log_("the collector at " + where_.host + ":" + where_.port + " does not take spans: " + why);
    }
}

} // namespace gateway
