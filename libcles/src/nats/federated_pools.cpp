// SPDX-License-Identifier: BSL-1.0
#include "nats/federated_pools.hpp"

#include <cles/error.hpp>
#include <cles/json_writer.hpp>

#include "federation/carried_line.hpp"
#include "node/local_node.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::nats {
namespace asio = boost::asio;
using bridging::bridge_link;

namespace {

constexpr std::size_t events_per_batch = 256;
constexpr int batches_per_turn = 8;
constexpr std::size_t reserved_room = 512U << 10U; // of what may wait for NATS, for short messages
constexpr std::chrono::milliseconds pool_appears_within{2'000};

class dial_errors final : public boost::system::error_category {
  public:
    constexpr dial_errors() noexcept : error_category(0xE25D'B790'3C18'4FA6U) {} // see protocol/error.cpp

    [[nodiscard]] const char* name() const noexcept override { return "cles.federation"; }
    [[nodiscard]] std::string message(int) const override { return "none of its bridges is connected to NATS"; }
};

boost::system::error_code no_bridge() {
    static const dial_errors category;
    return {1, category};
}

class pool_acceptor final : public acceptor {
  public:
    explicit pool_acceptor(std::shared_ptr<federated_pools> by) : by_(std::move(by)) {}
    ~pool_acceptor() override { by_->leave(); }
    pool_acceptor(const pool_acceptor&) = delete;
    pool_acceptor& operator=(const pool_acceptor&) = delete;

    [[nodiscard]] url local() const override {
        return {.scheme = "pool", .host = by_->own_pool(), .port = 0, .path = {}};
    }
    void start(std::function<void(link_ptr)> on_link) override { by_->accept(std::move(on_link)); }
    void close() override { by_->leave(); }

  private:
    std::shared_ptr<federated_pools> by_;
};

class pool_transport final : public link_transport {
  public:
    explicit pool_transport(std::weak_ptr<federated_pools> by) : by_(std::move(by)) {}

    [[nodiscard]] bool authenticates() const override { return by_.lock()->is_secured(); }
    // NATS listens for all hosts, unless it is told otherwise, and forwards to other servers.
    [[nodiscard]] bool is_exposed(const url&) const override { return true; }
    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url&, const limits& bounds) override {
        auto by = by_.lock();
        by->listen(executor, bounds);
        return std::make_unique<pool_acceptor>(std::move(by));
    }
    std::function<void()> dial(const asio::any_io_executor&, const url& where, const limits& bounds,
                               dial_callback done) override {
        return by_.lock()->dial(where.host, bounds, std::move(done));
    }

  private:
    std::weak_ptr<federated_pools> by_;
};

} // namespace

federated_pools::federated_pools(federation_options options) : options_(std::move(options)) {
    if (!bridging::is_pool_name(options_.pool)) {
        throw error(errc::invalid_name, "'" + options_.pool +
                                            "' is not a pool's name: 1 to 32 letters, digits, '_', '-'; not self, any, "
                                            "all");
    }
    if (options_.servers.empty()) {
        throw error(errc::invalid_option, "federation needs the URL of a NATS server");
    }
    for (const auto& server : options_.servers) {
        if (!server.starts_with("nats://") && !server.starts_with("tls://")) {
            throw error(errc::invalid_option,
                        "'" + server + "' is not the URL of a NATS server, as in nats://host:4222");
        }
    }
    if (options_.tls_certificate.empty() != options_.tls_key.empty()) {
        throw error(errc::invalid_option, "a certificate for NATS needs its key, and a key its certificate");
    }
}

federated_pools::~federated_pools() = default;

std::unique_ptr<link_transport> federated_pools::make_transport() {
    return std::make_unique<pool_transport>(weak_from_this());
}

// -- the node ------------------------------------------------------------------------------------------------------

void federated_pools::start(core::local_node& host) {
    host_ = host.weak_from_this();
    is_secured_ = host.node().security != nullptr;
    host.listeners().listen("pool://" + options_.pool, host.is_insecure());
}

void federated_pools::listen(const asio::any_io_executor& executor, const limits& bounds) {
    executor_ = executor;
    const auto host = host_.lock();
    bridge_.emplace(
        bridging::bridge::settings{.pool = options_.pool, .node = host->node().name, .max_line = bounds.line},
        static_cast<bridging::bridge_output&>(*this),
        is_secured_ ? static_cast<bridging::bridge_trust*>(this) : nullptr);
}

void federated_pools::accept(std::function<void(link_ptr)> on_link) {
    on_link_ = std::move(on_link);
    work_.emplace(executor_);
    timer_.emplace(executor_);
    connection_ = nats_connection::start(server_options{.servers = options_.servers,
                                                        .name = "cles " + host_.lock()->node().name,
                                                        .credentials = options_.credentials,
                                                        .token = options_.token,
                                                        .tls_authority = options_.tls_authority,
                                                        .tls_certificate = options_.tls_certificate,
                                                        .tls_key = options_.tls_key},
                                         [executor = executor_, weak = weak_from_this()] {
                                             asio::post(executor, [weak] {
                                                 if (const auto self = weak.lock()) {
                                                     self->on_wake();
                                                 }
                                             });
                                         });
}

std::string federated_pools::address_of(std::string_view target) const {
    const auto pool = bridge_ ? bridge_->pool_of(target, now()) : std::string{};
    return pool.empty() ? pool : "pool://" + pool;
}

void federated_pools::on_security_changed() {
    if (bridge_ && !stopped_) {
        if (channel_ && channel_->instance() != connected_as_) { // this node is another member, or none
            connection_->reconnect();
        }
        bridge_->on_security_changed(now());
        flush();
        run_later();
    }
}

std::vector<core::other_pools::known_pool> federated_pools::list() const {
    std::vector<known_pool> all;
    if (bridge_) {
        for (const auto& [name, known] : bridge_->pools().pools()) {
            if (name != options_.pool) {
                all.push_back({name, bridge_->is_live(name)});
            }
        }
    }
    return all;
}

void federated_pools::leave() {
    if (!std::exchange(leaving_, true) && connection_) {
        bridge_->leave(now());
        connection_->flush();
        run_later(); // which sets the timer
    }
    stop_if_finished();
}

// Without a connection, no session begins.
bool federated_pools::waits_for_session() {
    return bridge_->is_connected() && channel_ && channel_->has_waiting(now());
}

// Nothing is posted to the executor after that.
void federated_pools::stop_if_finished() {
    const auto node = host_.lock();
    const bool may_wait = node && !node->stopped() && connection_; // else the executor may end at once
    const bool has_drained = !may_wait || (bridge_->has_drained() && events_.empty() && !waits_for_session());
    if (leaving_ && links_.empty() && has_drained && !std::exchange(stopped_, true)) {
        if (connection_) {
            bridge_->say_left(now());
            connection_->flush();
            connection_->stop();
        }
        channel_.reset();
        if (timer_) {
            timer_->cancel();
        }
        dials_.clear();
        on_link_ = nullptr;
        work_.reset();
        if (node) {
            node->post_while_running([](core::local_node& host) { host.check_shutdown(); });
        }
    }
}

std::function<void()> federated_pools::dial(const std::string& pool, const limits& bounds, dial_callback done) {
    const auto number = ++last_dial_;
    dials_.push_back({number, pool, std::move(done), now() + std::min(bounds.connect, pool_appears_within)});
    run_later();
    return [weak = weak_from_this(), number] {
        if (const auto self = weak.lock()) {
            self->dials_.remove_if([number](const waiting_dial& d) { return d.number == number; });
        }
    };
}

void federated_pools::serve_dials() {
    std::list<waiting_dial> served;
    const auto at = now();
    for (auto next = dials_.begin(); next != dials_.end();) {
        const auto here = next++;
        if (bridge_->is_live(here->pool) || bridge_->has_left(here->pool) || here->until <= at) {
            served.splice(served.end(), dials_, here);
        }
    }
    for (const auto& each : served) {
        if (bridge_->is_live(each.pool) && !stopped_) {
            each.done({}, make_link({bridge_link::role::to_pool, each.pool, ++last_link_}));
        } else {
            each.done(no_bridge(), nullptr);
        }
    }
}

std::shared_ptr<pool_link> federated_pools::make_link(bridge_link which) {
    // The nouns for other pools are bound by this node, which states for whom.
    const bool is_own = which.what == bridge_link::role::publications && is_secured_;
    auto made = std::make_shared<pool_link>(std::shared_ptr<pool_link_owner>{shared_from_this(), this}, which,
                                            options_.pool, is_own ? host_.lock()->node().name : which.member);
    links_.insert_or_assign(std::move(which), made);
    return made;
}

// -- the thread and the timer --------------------------------------------------------------------------------------

void federated_pools::on_wake() {
    if (stopped_) {
        return;
    }
    more_waits_ = true;
    take_events();
    run();
}

// Only when those of the last time have been passed on: until then the thread keeps what it receives, and stops reading
// when that is too much.
void federated_pools::take_events() {
    if (events_.empty() && std::exchange(more_waits_, false)) {
        for (auto& each : connection_->take()) {
            events_.push_back(std::move(each));
        }
    }
}

void federated_pools::run_later() {
    if (!stopped_ && !std::exchange(run_posted_, true)) {
        asio::post(executor_, [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->run_posted_ = false;
                self->run();
            }
        });
    }
}

void federated_pools::run() {
    if (stopped_ || running_) {
        return;
    }
    const auto keep = shared_from_this();
    running_ = true;
    try {
        run_batches();
    } catch (...) { // of a handler, for the thread that runs the executor; the other lines are not affected
        running_ = false;
        run_later();
        throw;
    }
    running_ = false;
    if (stopped_) {
        return;
    }
    connection_->flush();
    take_events();
    stop_if_finished();
    if (stopped_) {
        return;
    }
    if (!events_.empty() || !ready_.empty() || !refused_.empty()) {
        run_later();
    }
    set_timer();
}

void federated_pools::run_batches() {
    for (int batch = 0; batch < batches_per_turn && !stopped_ && (batch == 0 || !events_.empty() || !ready_.empty());
         ++batch) {
        for (auto left = events_per_batch; left != 0 && !events_.empty() && !stopped_; --left) {
            const auto next = std::move(events_.front());
            events_.pop_front();
            on_event(next);
        }
        serve_dials();
        hand_over_all();
        if (!stopped_) {
            answer_refused();
            bridge_->on_batch();
        }
    }
    const bool is_slow = unsent() > pool_link::capacity;
    if (was_slow_ && !is_slow) {
        for (const auto& [which, link] : std::map{links_}) {
            link->on_writable();
        }
    }
    was_slow_ = is_slow;
}

void federated_pools::hand_over_all() {
    for (auto left = ready_.size(); left != 0 && !ready_.empty(); --left) {
        const auto link = std::move(ready_.front());
        ready_.pop_front();
        try {
            link->hand_over();
        } catch (...) {
            schedule(link);
            throw;
        }
    }
}

void federated_pools::set_timer() {
    auto due = bridge_->due();
    for (const auto& each : dials_) {
        due = std::min(due, each.until);
    }
    if (was_slow_) { // the thread does not say when it has sent everything
        due = std::min(due, now() + std::chrono::milliseconds{10});
    }
    if (due != time_point::max() && due < timer_due_) {
        timer_due_ = due;
        timer_->expires_after(std::max(due - now(), time_point::duration{0}));
        timer_->async_wait([weak = weak_from_this()](boost::system::error_code code) {
            if (const auto self = weak.lock()) {
                self->on_timer(code);
            }
        });
    }
}

void federated_pools::on_timer(boost::system::error_code code) {
    if (code || stopped_) {
        return;
    }
    timer_due_ = time_point::max();
    if (bridge_->due() <= now()) {
        bridge_->on_time(now());
    }
    run();
}

void federated_pools::on_event(const event& e) {
    const auto log_once = [this, &e](const std::string& text) {
        last_problem_ = e.text;
        if (logged_.take({.kind = "nats", .text = text, .most = 32, .in = std::chrono::hours{24}}, now())) {
            log(log_level::warning, text);
        }
    };
    switch (e.what) {
    case event::kind::connected: on_connected(e); break;
    case event::kind::disconnected:
        log_once("the connection to NATS was lost: " + e.text);
        bridge_->on_disconnected(e.text, now());
        break;
    case event::kind::refused: log_once("cannot connect to NATS: " + e.text + " (trying again)"); break;
    case event::kind::problem: log_once("NATS: " + e.text); break;
    case event::kind::message: on_message(e); break;
    }
}

void federated_pools::on_connected(const event& e) {
    log(log_level::info, "connected to NATS, as a bridge of the pool '" + options_.pool + "'");
    last_problem_.clear();
    logged_ = {};
    connection_->use(e.connection);
    if (!is_secured_) {
        std::random_device random;
        bridge_->on_connected((std::uint64_t{random()} << 32U) | random(), e.max_message, now());
        return;
    }
    const auto host = host_.lock();
    if (!host) {
        return;
    }
    channel_.emplace(host->node().security->seal_messages(), options_.pool);
    connected_as_ = channel_->instance();
    if (connected_as_ == 0) {
        log(log_level::error, "this node is not in the roster: it can seal nothing for other pools");
    }
    bridge_->on_connected(connected_as_, e.max_message - std::min(e.max_message, core::message_seal::overhead), now());
}

void federated_pools::on_message(const event& e) {
    const bridging::received_message received{e.subject, e.reply, e.text, now()};
    if (!is_secured_) {
        bridge_->on_message(received);
        return;
    }
    if (channel_) {
        channel_->receive(received, *bridge_);
    }
    if (channel_) { // a link that was refused may have been the last one
        for (auto& each : channel_->take_ready(received.at)) {
            connection_->publish(std::move(each.subject), std::move(each.reply), std::move(each.message));
        }
        publish_questions();
    }
}

void federated_pools::publish_questions() {
    constexpr std::size_t always_sent = 4096;
    for (auto& each : channel_->take_questions()) {
        if (each.message.size() > always_sent && unsent() + reserved_room > nats_connection::max_unsent) {
            continue; // a roster, which will be asked for again
        }
        connection_->publish(std::move(each.subject), channel_->questions(), std::move(each.message));
    }
}

// -- for the bridge ------------------------------------------------------------------------------------------------

bool federated_pools::publish(std::string subject, std::string reply, std::string message, room in) {
    const bool has_room = in == room::reserved || unsent() + reserved_room <= nats_connection::max_unsent;
    if (!connection_ || !has_room) {
        return false;
    }
    if (is_secured_) {
        if (!channel_) {
            return false;
        }
        auto sealed = channel_->seal(subject, reply, message, now());
        if (sealed.waits) { // for a session, which is asked for
            publish_questions();
            return true;
        }
        if (sealed.bytes.empty()) { // this node is no member, or too much waits
            return false;
        }
        message = std::move(sealed.bytes);
    }
    return connection_->publish(std::move(subject), std::move(reply), std::move(message));
}

// `run` does it once for all.
void federated_pools::flush() {
    if (!running_ && connection_) {
        connection_->flush();
    }
}

void federated_pools::subscribe(std::string subject, bool shared) {
    const bool is_feed = bridging::parse_subject(subject).kind == bridging::subject_kind::feed;
    connection_->subscribe(std::move(subject), shared ? std::string{bridging::queue_group} : std::string{}, is_feed);
    flush();
}

void federated_pools::unsubscribe(const std::string& subject) {
    connection_->unsubscribe(subject);
    flush();
}

void federated_pools::deliver(const bridge_link& on, std::string line) {
    auto found = links_.find(on);
    if (found == links_.end()) {
        if (on.what == bridge_link::role::to_pool || !on_link_) {
            return;
        }
        const auto made = make_link(on);
        on_link_(made);
        found = links_.find(on);
        if (found == links_.end()) { // refused
            return;
        }
    }
    if (!found->second->is_full() || !refuse(on, line)) {
        found->second->deliver(std::move(line));
    }
}

// Returns false for what has to reach the node: cancellations, bindings, and replies to its own requests, which are as
// many as the node has asked for.
bool federated_pools::refuse(const bridge_link& on, std::string_view line) {
    protocol::request_line r;
    protocol::malformed_request wrong;
    if (protocol::is_reply(line) || !protocol::parse_request(line, r, wrong)) {
        return false;
    }
    if (on.what == bridge_link::role::to_pool) {
        updates_dropped_ += r.is_update() ? 1 : 0; // shows as a gap
        return r.is_update();
    }
    if (on.what != bridge_link::role::from_pool || r.noun.target == "self") {
        return false;
    }
    refused_.emplace_back(on, r.id); // the bridge is not called from inside its own call
    return true;
}

// As the node's replies, before the bridge acknowledges the requests of this batch.
void federated_pools::answer_refused() {
    for (const auto& [on, id] : std::exchange(refused_, {})) {
        const auto why = protocol::failure_text({.code = errc::busy,
                                                 .message = "too many requests of other pools wait at this bridge",
                                                 .retry_ms = protocol::default_retry_ms});
        bridge_->on_line(on, bridging::reply_line(id, why), now());
    }
}

template <class Condition>
void federated_pools::lose_if(Condition concerns, std::string_view why) {
    for (auto next = links_.begin(); next != links_.end();) {
        const auto here = next++;
        if (concerns(here->first)) {
            const auto link = here->second;
            links_.erase(here); // another one may be opened before the node knows
            link->lose(why);
        }
    }
}

void federated_pools::end(const bridge_link& which) {
    lose_if([&which](const bridge_link& l) { return l == which; }, "nothing is bound on it any more");
}

void federated_pools::lose_pool(std::string_view pool, std::string_view why) {
    lose_if([pool](const bridge_link& l) { return l.what != bridge_link::role::publications && l.pool == pool; }, why);
}

void federated_pools::lose_all(std::string_view why) {
    lose_if([](const bridge_link&) { return true; }, why);
}

void federated_pools::lose_binding(const bridge_link& on, const std::string& noun, std::string_view why) {
    if (const auto found = links_.find(on); found != links_.end()) {
        found->second->lose_binding(noun, why);
    }
}

void federated_pools::on_pools_changed() {
    if (const auto host = host_.lock()) {
        host->peer_channels().on_links_changed();
    }
    if (!dials_.empty()) {
        run_later();
    }
}

std::vector<std::string> federated_pools::home_names() const {
    std::vector<std::string> names;
    if (const auto host = host_.lock()) {
        names.push_back(host->node().name);
        for (auto& each : host->node().list_peers(now())) {
            names.push_back(std::move(each.node));
        }
    }
    return names;
}

void federated_pools::log(log_level level, const std::string& text) {
    if (const auto host = host_.lock()) {
        host->post_log(level, text);
    }
}

// -- members -------------------------------------------------------------------------------------------------------

bool federated_pools::may_forward(std::string_view member) const {
    const auto host = host_.lock();
    return host && host->node().security->may_forward(member, host->node().name);
}

std::string federated_pools::how_to_permit(std::string_view member) const {
    const auto host = host_.lock();
    return core::how_to_permit_forwarding(member, host ? host->node().name : std::string{});
}

std::optional<protocol::failure> federated_pools::refusal(std::string_view member,
                                                          const protocol::request_line& bind) const {
    const auto host = host_.lock();
    const auto peer =
        pool_link::identity_of({.what = bridge_link::role::publications}, options_.pool, std::string{member});
    return host ? core::refusal_reason(host->node(), peer, bind) : std::nullopt;
}

std::uint32_t federated_pools::roster_version() const {
    const auto host = host_.lock();
    return host ? host->node().security->roster_version() : 0;
}

void federated_pools::on_lost(const bridging::bridge_id& gone) {
    if (channel_) {
        channel_->forget(gone);
    }
}

void federated_pools::on_stated_roster(const bridging::bridge_id& by, std::uint32_t version) {
    if (channel_) {
        channel_->on_stated_roster(by, version, now());
    }
}

void federated_pools::on_stated_sessions(const bridging::bridge_id& by) {
    if (channel_) {
        channel_->on_stated_sessions(by, now());
    }
}

// -- for the links -------------------------------------------------------------------------------------------------

void federated_pools::on_line(const bridge_link& from, std::string_view line) { bridge_->on_line(from, line, now()); }

void federated_pools::schedule(std::shared_ptr<pool_link> which) {
    ready_.push_back(std::move(which));
    if (!running_) {
        run_later();
    }
}

void federated_pools::on_flushed() {
    if (!running_ && connection_) {
        connection_->flush();
        if (!was_slow_ && unsent() > pool_link::capacity) {
            was_slow_ = true;
            set_timer();
        }
    }
}

void federated_pools::on_closed(pool_link& which) {
    const auto found = links_.find(which.which());
    if (found != links_.end() && found->second.get() == &which) {
        const auto keep = found->second;
        links_.erase(found);
        bridge_->on_closed(which.which());
        flush();
    }
    stop_if_finished();
}

std::size_t federated_pools::unsent() const { return connection_ ? connection_->unsent() : 0; }
std::uint64_t federated_pools::given() const { return connection_ ? connection_->given() : 0; }

void federated_pools::write_metrics(json_writer& w) const {
    w.begin_object();
    w.key("pool");
    w.value(std::string_view{options_.pool});
    w.key("connected");
    w.value(bridge_ && bridge_->is_connected());
    if (!last_problem_.empty()) {
        w.key("problem");
        w.value(std::string_view{last_problem_});
    }
    if (channel_) {
        w.key("member");
        w.value(connected_as_ != 0);
    }
    if (bridge_) {
        if (!bridge_->not_permitted().empty()) {
            w.key("not_permitted");
            w.begin_array();
            for (const auto& member : bridge_->not_permitted()) {
                w.value(std::string_view{member});
            }
            w.end_array();
        }
        w.key("pools");
        w.begin_array();
        for (const auto& [name, p] : bridge_->pools().pools()) {
            if (name != options_.pool) {
                w.begin_object();
                w.key("pool");
                w.value(std::string_view{name});
                w.key("state");
                w.value(std::string_view{p.bridges.empty() ? "lost" : "live"});
                w.key("bridges");
                w.value(std::uint64_t{p.bridges.size()});
                w.key("nodes");
                w.value(std::uint64_t{bridging::pool_table::node_count(p)});
                w.end_object();
            }
        }
        w.end_array();
        if (const auto took = bridge_->is_connected() ? bridge_->round_trip() : std::nullopt) {
            w.key("round_trip_us");
            w.value(static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(*took).count()));
        }
        const auto& f = bridge_->counted();
        for (const auto& [key, value] :
             {std::pair{"bridges", std::uint64_t{bridge_->pools().bridge_count()}},
              std::pair{"connections", f.connections}, std::pair{"bridges_lost", f.bridges_lost},
              std::pair{"requests_sent", f.requests_sent}, std::pair{"requests_taken", f.requests_taken},
              std::pair{"updates_sent", f.updates_sent}, std::pair{"updates_received", f.updates_received},
              std::pair{"updates_dropped_to_nats", f.updates_dropped},
              std::pair{"updates_dropped_to_node", updates_dropped_}, std::pair{"messages_refused", f.messages_refused},
              std::pair{"messages_dropped", connection_ ? connection_->dropped() : 0},
              std::pair{"unsent", std::uint64_t{unsent()}}}) {
            w.key(key);
            w.value(value);
        }
    }
    w.end_object();
}

} // namespace cles::nats
