// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/exchanges.hpp"

#include "gateway/told/openapi.hpp"
#include "gateway/told/told_limits.hpp"
#include "gateway/told/update_events.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace gateway {
namespace asio = boost::asio;
using boost::system::error_code;
using namespace std::chrono_literals;

namespace {

constexpr auto patience_with_all = 2s;
constexpr auto patience_with_one = 500ms;
constexpr auto patience_with_types = 3s;              // of all nodes
constexpr std::size_t most_types_of_task = 1U << 20U; // bytes, of what a node tells
constexpr std::size_t most_types_at_once = 8U << 20U; // of one document
constexpr std::size_t most_types_known = 16U << 20U;
constexpr std::size_t most_told_by_all = 32U << 20U; // bytes, if each is asked
constexpr std::size_t most_asked_at_once = 16;

/// What all have in common: the client, which is null once it is gone, or has its response.
class client_exchange : public exchange {
  public:
    client_exchange(std::shared_ptr<response_sink> to, asked asked_for)
        : to_(std::move(to)), what_(std::move(asked_for)) {}

    void cancel() override { to_.reset(); }
    void on_silence() override { static_cast<void>(may_be_told()); }

  protected:
    [[nodiscard]] bool is_wanted() const noexcept { return to_ != nullptr; }
    /// Whether the client is there, and may still use the gateway; asked before it is told anything. If its token or
    /// session has ended, it is told so, and what it has asked for is cancelled.
    [[nodiscard]] bool may_be_told() {
        if (to_ == nullptr || what_.is_admitted()) {
            return to_ != nullptr;
        }
        constexpr std::string_view reason = "the token or the session has ended";
        if (has_begun_) {
            end_with("failure", failure_text(cles::errc::denied, reason));
        } else {
            refusal ended{.status = 401, .message = std::string{reason}, .fields = what_.fields};
            ended.fields.emplace_back("WWW-Authenticate", "Bearer");
            std::exchange(to_, nullptr)->respond(response_of(ended));
        }
        cancel();
        return false;
    }
    [[nodiscard]] const asked& what() const noexcept { return what_; }
    [[nodiscard]] std::string& why() noexcept { return why_; }
    [[nodiscard]] bool has_begun() const noexcept { return has_begun_; }
    void begin_events() {
        has_begun_ = true;
        to_->begin_events(what_.fields);
    }
    void send(std::string_view events) {
        if (const auto to = to_) {
            to->send(events);
        }
    }
    void end_with(std::string_view type, std::string_view data) {
        std::string event;
        append_event(event, type, {}, data);
        const auto to = std::exchange(to_, nullptr);
        to->send(event);
        to->end_events();
    }
    void respond(std::string body, std::string_view type = "application/json") {
        if (may_be_told()) {
            std::exchange(to_, nullptr)
                ->respond({.status = 200, .type = std::string{type}, .body = std::move(body), .fields = what_.fields});
        }
    }
    void respond(error_code code, std::string_view failure = {}) {
        if (may_be_told()) {
            std::exchange(to_, nullptr)->respond(response_to_failure(code, why_, failure, what_.fields));
        }
    }

  private:
    std::shared_ptr<response_sink> to_;
    asked what_;
    std::string why_;        // a failure
    bool has_begun_ = false; // a stream
};

class request_exchange final : public client_exchange, public std::enable_shared_from_this<request_exchange> {
  public:
    request_exchange(std::shared_ptr<response_sink> to, asked asked_for, bool wants_events,
                     std::function<void(std::string_view outcome)> ended)
        : client_exchange(std::move(to), std::move(asked_for)), wants_events_(wants_events), ended_(std::move(ended)) {}

    void start(cles::service& node, cles::call_options options, std::string_view body) {
        options.diagnostics(why()).failure(failure_);
        what().state_member(options);
        if (wants_events_) {
            options.on_progress([weak = weak_from_this()](double fraction, std::string_view details) {
                if (const auto self = weak.lock()) {
                    self->on_progress(fraction, details);
                }
            });
        }
        std::string command{cles::to_string(what().where.verb)};
        command.append(" ").append(what().where.noun).append(body.empty() ? "" : " ").append(body);
        auto then = [self = shared_from_this()](error_code code, const cles::json_text& reply) {
            self->on_reply(code, reply.text);
        };
        node.async_request(command, options, asio::bind_cancellation_slot(cancel_.slot(), std::move(then)));
    }
    void cancel() override {
        client_exchange::cancel();
        cancel_.emit(asio::cancellation_type::all);
    }
    void on_writable() override {
        is_writable_ = true;
        send_progress();
    }

  private:
    // Only the newest report waits for a slow client.
    void on_progress(double fraction, std::string_view details) {
        if (!may_be_told()) {
            return;
        }
        progress_ = R"({"fraction":)" + cles::to_json(fraction) + R"(,"details":)" + std::string{details} + "}";
        if (!has_begun()) {
            begin_events();
        }
        send_progress();
    }
    void send_progress() {
        if (is_writable_ && !progress_.empty() && may_be_told()) {
            std::string event;
            append_event(event, "progress", {}, progress_);
            progress_.clear();
            is_writable_ = false;
            send(event);
        }
    }
    void on_reply(error_code code, const std::string& json) {
        if (ended_) {
            ended_(code ? cles::wire_name(told_code(code)) : std::string_view{"ok"});
        }
        if (!may_be_told()) {
            return;
        }
        if (code && !has_begun()) {
            respond(code, failure_);
        } else if (!wants_events_) {
            respond(json);
        } else {
            if (!has_begun()) {
                begin_events();
            }
            end_with(code ? "failure" : "result", code ? response_to_failure(code, why(), failure_, {}).body : json);
        }
    }

    bool wants_events_;
    std::function<void(std::string_view outcome)> ended_;
    asio::cancellation_signal cancel_;
    std::string failure_;
    std::string progress_; // the last report, if it has not been sent
    bool is_writable_ = false;
};

// Its publisher is not there now, but may come. \param was_away a node that is starting may not have all its tasks yet
bool may_come(error_code code, bool was_away) noexcept {
    switch (told_code(code)) {
    case cles::errc::no_target:
    case cles::errc::unavailable:
    case cles::errc::busy:
    case cles::errc::deadline: return true;
    case cles::errc::no_task: return was_away;
    default: return false;
    }
}

class binding_exchange final : public client_exchange, public std::enable_shared_from_this<binding_exchange> {
  public:
    binding_exchange(std::shared_ptr<response_sink> to, asked asked_for, cles::service& node,
                     std::chrono::milliseconds deadline, std::string_view last, gateway_counts& counts)
        : client_exchange(std::move(to), std::move(asked_for)), node_(node), deadline_(deadline), counts_(counts),
          events_(what().where.target == "all" || what().where.target.ends_with(".all"), what().where.every.count() > 0,
                  mark_in(last)),
          retry_(node.get_executor()) {}

    void bind() {
        cles::bind_options options;
        options.every(what().where.every).keep(what().where.keep).mark().deadline(deadline_).diagnostics(why());
        what().state_member(options);
        auto then = [self = shared_from_this()](error_code code, cles::feed<cles::json_text> made) {
            self->on_bound(code, std::move(made));
        };
        node_.async_bind(what().where.noun, options, asio::bind_cancellation_slot(cancel_.slot(), std::move(then)));
    }
    void cancel() override {
        client_exchange::cancel();
        cancel_.emit(asio::cancellation_type::all);
        retry_.cancel();
        feed_.close();
    }
    void on_writable() override {
        if (is_wanted() && feed_.is_open() && !std::exchange(is_waiting_, true)) {
            feed_.async_next(
                [self = shared_from_this()](error_code code, const cles::feed_item<cles::json_text>& item) {
                    self->on_item(code, item);
                });
        }
    }

  private:
    void on_bound(error_code code, cles::feed<cles::json_text> made) {
        if (!may_be_told()) {
            return;
        }
        if (code) {
            on_not_bound(code);
            return;
        }
        feed_ = std::move(made);
        if (has_begun()) {
            tell(cles::feed_event::rebound);
        } else {
            begin();
        }
    }
    // Browsers do not come back after any status but 200. So a stream begins without its publisher, and waits for it.
    void on_not_bound(error_code code) {
        if (!may_come(code, has_begun())) {
            if (has_begun()) {
                end_with("failure", failure_text(told_code(code), why()));
            } else {
                respond(code);
            }
            return;
        }
        if (!has_begun()) {
            begin();
            tell(cles::feed_event::lost, why());
        }
        retry_.expires_after(delay_);
        delay_ = std::min(delay_ * 2, longest_delay);
        retry_.async_wait([self = shared_from_this()](error_code failed) {
            if (!failed && self->may_be_told()) {
                self->bind();
            }
        });
    }
    void begin() {
        begin_events();
        send("retry: 1000\n\n"); // until the browser comes back, in milliseconds
    }
    void tell(cles::feed_event kind, const std::string& reason = {}) {
        cles::feed_item<cles::json_text> item;
        item.kind = kind;
        item.text = reason;
        std::string text;
        events_.take(item, text);
        ++counts_.events_sent;
        send(text);
    }
    void on_item(error_code code, const cles::feed_item<cles::json_text>& item) {
        is_waiting_ = false;
        if (!may_be_told()) {
            return;
        }
        if (code) {
            feed_.close();
            end_with("failure", failure_text(told_code(code), code.message()));
            return;
        }
        ++counts_.events_sent;
        counts_.updates_missed += item.missed;
        std::string text;
        events_.take(item, text);
        if (text.empty()) { // the client has it already
            on_writable();
        } else {
            send(text);
        }
    }

    static constexpr std::chrono::milliseconds longest_delay{5'000};

    cles::service& node_;
    std::chrono::milliseconds deadline_;
    gateway_counts& counts_;
    update_events events_;
    asio::steady_timer retry_;
    std::chrono::milliseconds delay_{500};
    asio::cancellation_signal cancel_;
    cles::feed<cles::json_text> feed_;
    bool is_waiting_ = false;
};

/// What all nodes tell. The node of the gateway is not there any more if nobody wants the response.
class fleet_exchange : public client_exchange, public std::enable_shared_from_this<fleet_exchange> {
  public:
    fleet_exchange(std::shared_ptr<response_sink> to, asked asked_for, cles::service& node, std::string path)
        : client_exchange(std::move(to), std::move(asked_for)), node_(node), path_(std::move(path)) {}

    /// Asks all at once. If the replies of a large fleet are too much for one, each node that is known is asked.
    void start() {
        auto chosen = options(patience_with_all);
        chosen.diagnostics(why());
        node_.async_pull("all:" + path_, chosen,
                         [self = shared_from_this()](error_code code, const cles::json_text& reply) {
                             if (code == cles::errc::too_large && self->is_wanted()) {
                                 self->ask_each();
                             } else if (code) {
                                 self->respond(code);
                             } else if (self->is_wanted()) {
                                 self->on_replies(results_of_all(reply.text));
                             }
                         });
    }

  protected:
    virtual void on_replies(std::map<std::string, std::string> told) = 0;
    [[nodiscard]] cles::service& node() const noexcept { return node_; }
    [[nodiscard]] cles::call_options options(std::chrono::milliseconds deadline) const {
        cles::call_options made;
        made.deadline(deadline);
        what().state_member(made);
        return made;
    }

  private:
    void ask_each() {
        left_.emplace(0ms, node_.name());
        for (const auto& peer : node_.peers()) {
            left_.emplace(peer.age, peer.node);
        }
        end_ = std::chrono::steady_clock::now() + patience_with_all;
        ask_next();
    }
    void ask_next() {
        while (open_ < most_asked_at_once && !left_.empty() && std::chrono::steady_clock::now() < end_) {
            const auto name = std::move(left_.extract(left_.begin()).value().second);
            ++open_;
            node_.async_pull(name + ":" + path_, options(patience_with_one),
                             [self = shared_from_this(), name](error_code code, const cles::json_text& reply) {
                                 self->take(name, code ? std::string{} : reply.text);
                             });
        }
        if (open_ == 0) {
            on_replies(std::move(told_));
        }
    }
    void take(const std::string& name, const std::string& text) {
        --open_;
        const bool is_kept = text.size() <= told_limits::reply && bytes_ + text.size() <= most_told_by_all;
        if (!text.empty() && is_kept && told_.emplace(name, text).second) {
            bytes_ += text.size();
        }
        if (is_wanted()) {
            ask_next();
        }
    }

    cles::service& node_;
    std::string path_;
    // To be asked, those first that were heard last: silent ones must not use up the time of others.
    std::set<std::pair<std::chrono::milliseconds, std::string>> left_;
    std::size_t open_ = 0;  // that are asked
    std::size_t bytes_ = 0; // that are kept
    std::map<std::string, std::string> told_;
    std::chrono::steady_clock::time_point end_{};
};

class metrics_exchange final : public fleet_exchange {
  public:
    metrics_exchange(std::shared_ptr<response_sink> to, asked asked_for, cles::service& node, metrics_format format)
        : fleet_exchange(std::move(to), std::move(asked_for), node, "cles/metrics"), format_(format) {}

  private:
    void on_replies(std::map<std::string, std::string> told) override {
        respond(metrics_text(told, format_), type_of(format_));
    }

    metrics_format format_;
};

class openapi_exchange final : public fleet_exchange {
  public:
    openapi_exchange(std::shared_ptr<response_sink> to, asked asked_for, cles::service& node, type_cache& known)
        : fleet_exchange(std::move(to), std::move(asked_for), node, "cles"), known_(known) {}

  private:
    void on_replies(std::map<std::string, std::string> told) override {
        until_ = std::chrono::steady_clock::now() + patience_with_types;
        auto self = std::static_pointer_cast<openapi_exchange>(shared_from_this());
        asio::co_spawn(node().get_executor(), run(std::move(self), offering_nodes(told)), asio::detached);
    }

    static asio::awaitable<void> run(std::shared_ptr<openapi_exchange> self, std::vector<offering_node> nodes) {
        for (auto& node : nodes) {
            co_await self->ask_for_types(node);
        }
        if (self->is_wanted()) {
            self->respond(openapi_document(nodes));
        }
    }

    asio::awaitable<void> ask_for_types(offering_node& of) {
        std::set<std::string> tasks;
        for (const auto& each : of.tasks) {
            tasks.insert(each.task);
        }
        for (const auto& task : tasks) {
            const bool is_late = std::chrono::steady_clock::now() > until_;
            if (of.types.empty() || !is_wanted() || is_late || types_told_ > most_types_at_once) {
                co_return;
            }
            const auto key = what().who.name + " " + of.name + " " + of.types + " " + task;
            std::string told;
            if (const auto* const known = known_.find(key)) {
                told = *known;
            } else {
                const auto noun = of.name + ":cles/types/" + task;
                const auto chosen = options(patience_with_one);
                try {
                    const cles::json_text reply = co_await node().async_pull(noun, chosen);
                    told = reply.text;
                } catch (const cles::error&) { // it may not be asked, or is gone
                    continue;
                }
                if (!is_wanted()) {
                    co_return;
                }
                known_.keep(key, told);
            }
            if (told.size() <= most_types_of_task) {
                types_told_ += told.size();
                add_schemas(of, task, told);
            }
        }
    }

    type_cache& known_;
    std::size_t types_told_ = 0; // bytes
    std::chrono::steady_clock::time_point until_{};
};

} // namespace

const std::string* type_cache::find(const std::string& key) const {
    const auto found = told_.find(key);
    return found == told_.end() ? nullptr : &found->second;
}

void type_cache::keep(const std::string& key, const std::string& told) {
    constexpr std::size_t per_entry = 256; // about what the map needs besides
    const auto size = key.size() + told.size() + per_entry;
    if (told.size() > most_types_of_task) {
        return;
    }
    if (bytes_ + size > most_types_known) {
        told_.clear();
        bytes_ = 0;
    }
    if (told_.emplace(key, told).second) {
        bytes_ += size;
    }
}

std::shared_ptr<exchange> begin_request(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        const cles::call_options& options, std::string_view body, bool wants_events,
                                        std::function<void(std::string_view outcome)> ended) {
    auto made = std::make_shared<request_exchange>(std::move(to), std::move(what), wants_events, std::move(ended));
    made->start(node, options, body);
    return made;
}

std::shared_ptr<exchange> begin_binding(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        std::chrono::milliseconds deadline, std::string_view last_event_id,
                                        gateway_counts& counts) {
    auto made =
        std::make_shared<binding_exchange>(std::move(to), std::move(what), node, deadline, last_event_id, counts);
    made->bind();
    return made;
}

std::shared_ptr<exchange> begin_metrics(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        metrics_format format) {
    auto made = std::make_shared<metrics_exchange>(std::move(to), std::move(what), node, format);
    made->start();
    return made;
}

std::shared_ptr<exchange> begin_openapi(cles::service& node, std::shared_ptr<response_sink> to, asked what,
                                        type_cache& known) {
    auto made = std::make_shared<openapi_exchange>(std::move(to), std::move(what), node, known);
    made->start();
    return made;
}

} // namespace gateway
