// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/span_exporter.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/limits.hpp>
#include <cles/link.hpp>

#include "gateway/access/tokens.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/system/error_code.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <utility>

namespace gateway {
namespace asio = boost::asio;
using namespace std::chrono_literals;
using boost::system::error_code;

namespace {

constexpr std::string_view scheme = "http://";
constexpr auto pause_between = 1s;
constexpr auto patience_with_node = 1s;
constexpr auto patience_with_collector = 5s; // until it is connected, and again until it replies
constexpr std::size_t most_waiting = 4096;
constexpr std::size_t most_at_once = 1024;
constexpr std::size_t most_collections = 8; // in progress; of other requests, only the gateway's own span is told
constexpr std::size_t longest_status_line = 1024;
constexpr std::size_t most_asked = 32; // nodes of one trace

std::int64_t unix_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
}

std::string request_text(const collector_address& to, const std::string& document) {
    return "POST " + to.path + " HTTP/1.1\r\nHost: " + cles::to_string(to.at).substr(scheme.size()) +
           "\r\nContent-Type: application/json\r\nConnection: close\r\nContent-Length: " +
           std::to_string(document.size()) + "\r\n\r\n" + document;
}

} // namespace

/// A request to the collector, by a link of the library, whose lookup nothing waits for and whose socket no program
/// inherits.
class span_exporter::delivery final : public cles::link_events, public std::enable_shared_from_this<delivery> {
  public:
    /// \param done called once: why the collector has not taken it; empty if it has
    delivery(const asio::any_io_executor& executor, std::function<void(const std::string&)> done)
        : limit_(executor), done_(std::move(done)) {}

    void start(const cles::url& to, std::string request) {
        cles::limits bounds;
        bounds.connect = patience_with_collector;
        bounds.line = longest_status_line;
        auto connected = [self = shared_from_this(), request = std::move(request)](error_code code,
                                                                                   cles::link_ptr made) {
            self->link_ = std::move(made);
            if (code) {
                self->end(code.message());
                return;
            }
            self->limit_.expires_after(patience_with_collector);
            self->limit_.async_wait([self](error_code cancelled) {
                if (!cancelled) {
                    self->end("it does not reply in time");
                }
            });
            self->link_->start(self);
            self->link_->output() = request;
            self->link_->flush();
        };
        give_up_ = cles::find_transport("tcp")->dial(limit_.get_executor(), to, bounds, std::move(connected));
    }
    void close() {
        done_ = nullptr;
        limit_.cancel();
        give_up_();
        if (link_) {
            link_->close();
        }
    }

    void on_line(std::string_view line) override {
        const auto status = line.substr(0, line.find('\r'));
        const auto code = status.substr(std::min(status.find(' ') + 1, status.size()));
        end(code.starts_with('2') ? std::string{} : "it replies " + std::string{status});
    }
    void on_overlong(std::string_view head) override { on_line(head); }
    void on_batch() override {}
    void on_end() override { end("it ends the connection without a reply"); }
    void on_lost(error_code why) override { end(why.message()); }
    void on_writable() override {}

  private:
    void end(const std::string& why) {
        const auto self = shared_from_this();
        if (const auto done = std::exchange(done_, nullptr)) {
            close();
            done(why);
        }
    }

    asio::steady_timer limit_;
    std::function<void(const std::string&)> done_;
    std::function<void()> give_up_;
    cles::link_ptr link_;
};

collector_address collector_at(const std::string& url) {
    const auto slash = std::min(url.find('/', scheme.size()), url.size());
    auto at = url.substr(0, slash);
    if (!url.starts_with(scheme) || at.find('?') != std::string::npos ||
        url.find_first_of(" \r\n") != std::string::npos) {
        throw std::runtime_error("'" + url +
                                 "': write http://HOST:PORT, where a collector is on a network that is trusted");
    }
    if (at.find(':', std::max(scheme.size(), at.find(']') + 1)) == std::string::npos) {
        at += ":4318";
    }
    const auto path = url.substr(slash);
    return {.at = cles::parse_url(at), .path = path.size() > 1 ? path : "/v1/traces"};
}

span_exporter::span_exporter(cles::service& node, collector_address where, gateway_counts& counts,
                             std::function<void(const std::string&)> log)
    : node_(&node), where_(std::move(where)), counts_(counts), log_(std::move(log)), timer_(node.get_executor()) {}

void span_exporter::stop() {
    node_ = nullptr;
    timer_.cancel();
    if (const auto stopped = std::exchange(sending_, nullptr)) {
        stopped->close();
    }
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

void span_exporter::send_later() {
    timer_.expires_after(pause_between);
    timer_.async_wait([self = shared_from_this()](error_code code) {
        if (!code) {
            self->send();
        }
    });
}

void span_exporter::send() {
    if (node_ == nullptr) {
        return;
    }
    if (waiting_.empty()) {
        send_later();
        return;
    }
    const auto count = std::min(waiting_.size(), most_at_once);
    const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(count);
    const auto document = otlp_document({waiting_.begin(), end});
    waiting_.erase(waiting_.begin(), end);
    sending_ =
        std::make_shared<delivery>(timer_.get_executor(), [self = shared_from_this(), count](const std::string& why) {
            self->on_sent(count, why);
        });
    sending_->start(where_.at, request_text(where_, document));
}

void span_exporter::on_sent(std::size_t count, const std::string& why) {
    (why.empty() ? counts_.spans_sent : counts_.spans_dropped) += count;
    const auto now = std::chrono::steady_clock::now();
    if (!why.empty() && (logged_ == std::chrono::steady_clock::time_point{} || now - logged_ > 1min)) {
        logged_ = now;
        log_("the collector at " + cles::to_string(where_.at) + " does not take spans: " + why);
    }
    sending_ = nullptr;
    why.empty() ? send() : send_later();
}

} // namespace gateway
