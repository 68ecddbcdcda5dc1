// SPDX-License-Identifier: BSL-1.0
#include "node/session/connection.hpp"

#include "node/local_node.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "node/publish/feed_machine.hpp"
#include "node/routing/peer_channels.hpp"
#include "node/session/request_checks.hpp"

#include <utility>

namespace cles::core {
namespace {

constexpr unsigned lines_per_write = 32;
constexpr std::size_t udp_over_v4 = 28; // bytes of headers
constexpr std::size_t udp_over_v6 = 48;
constexpr std::size_t update_backpressure_limit = 65536; // unsent bytes beyond which updates stay in their topics
constexpr std::size_t idle_buffer_limit = 32768;         // bytes that an idle link may keep
constexpr std::chrono::seconds idle_after{2};

} // namespace

connection::connection(std::shared_ptr<local_node> host, link_ptr carrier, origin from, std::uint64_t number)
    : host_(std::move(host)), link_(std::move(carrier)), from_(from), number_(number),
      memory_(std::make_shared<memory_account>(host_->node().memory)),
      session_(host_->shared_node(), *this, *this, link_->peer()) {
    const bool accepted = from_ == origin::accepted;
    if (from_ == origin::dialled) { // bindings by datagram have leases
        const auto silence = link_->datagram() == 0 ? host_->bounds().silence : std::chrono::milliseconds{0};
        node_there_ = std::make_unique<link_peer>(static_cast<link_peer::owner&>(*this), host_->deadlines(), silence);
    }
    if (accepted || link_->datagram() == 0) {
        monitor_.emplace(static_cast<link_monitor::owner&>(*this), host_->deadlines(), host_->bounds(), host_->now());
    }
    if (link_->datagram() == 0) {
        if (accepted) {
            monitor_->expect_line();
        }
        return;
    }
    const auto unverified_address =
        accepted || from_ == origin::refused ? host_->unverified_address(link_->peer()) : std::string{};
    const bool is_v6 = unverified_address.find(':') != std::string::npos;
    datagrams_.emplace(host_->node(), link_->datagram(), unverified_address, is_v6 ? udp_over_v6 : udp_over_v4);
    if (accepted) {
        monitor_->expect_datagrams();
    }
}

connection::~connection() = default;

void connection::start() { link_->start(shared_from_this()); }

time_point connection::now() { return now_ ? *now_ : *(now_ = host_->now()); }

// -- from the link -------------------------------------------------------------------------------------------------

bool connection::accept_input(std::string_view text) {
    if (from_ == origin::refused) {
        session_.reject(text);
        return false;
    }
    if (monitor_ && (datagrams_ || !text.empty())) {
        monitor_->on_line(now());
    }
    if (node_there_) {
        node_there_->on_line(now());
    }
    return true;
}

void connection::on_line(std::string_view line) {
    if (!accept_input(line)) {
        return;
    }
    if (host_->node().active_router == nullptr) {
        session_.on_line(line, now());
    } else { // it may be forwarded
        host_->flush_scheduler().run_line([&] { session_.on_line(line, now()); },
                                          [this] { return !gone_ && link_->unsent() == 0; });
    }
    // In a long batch, the first replies leave early: with many requests in flight, neither end then waits for the
    // other.
    if (++lines_ % lines_per_write == 0 || link_->output().size() > host_->bounds().unread) {
        flush();
    }
    rethrow_handler_exception();
}

// A handler's exception passes through the link, which delivers the remaining lines later and may not end this batch.
void connection::rethrow_handler_exception() {
    if (host_->completions().has_thrown()) {
        const auto keep = shared_from_this();
        now_.reset();
        host_->flush_scheduler().flush_soon(*this);
        host_->completions().rethrow();
    }
}

void connection::on_overlong(std::string_view head) {
    if (accept_input(head)) {
        session_.on_overlong(head);
    }
}

void connection::on_cut(std::string_view rest) { session_.on_cut(rest); }

void connection::on_batch() {
    const auto keep = shared_from_this();
    flush();
    lines_ = 0;
    now_.reset();
    host_->check_shutdown();
    if (from_ == origin::refused) {
        abandon("the limit of links is reached");
    }
}

void connection::on_end() {
    usable_ = false;
    lose_feeds("the publisher ended the link");
    session_.on_end();
    if (monitor_ && !finished_ && !gone_) {
        monitor_->on_end(now());
    }
}

void connection::on_lost(boost::system::error_code why) {
    host_->connections().on_closed_gracefully(*link_);
    end("the link was lost: " + why.message());
}

void connection::on_writable() {
    const auto keep = shared_from_this();
    session_.serving().drain(host_->now());
    flush();
    host_->check_shutdown();
}

void connection::on_restart() {
    const auto keep = shared_from_this();
    if (node_there_) {
        node_there_->forget();
    }
    lose_bound({}, "the publisher has restarted");
    session_.asking().on_restart(host_->now());
}

void connection::on_binding_lost(std::string_view noun, const std::string& why) {
    const auto keep = shared_from_this();
    lose_bound(noun, why);
}

void connection::lose_bound(std::string_view noun, const std::string& why) {
    const auto at = host_->now();
    for (auto* const feed : std::vector{feeds_}) {
        // A BIND that was not answered is sent again, or fails.
        if (feed->is_bound() && (noun.empty() || noun == feed->entry().terms.noun)) {
            unbind(*feed);
            feed->on_lost(why, at);
        }
    }
}

// Over TLS, both ends get the newer roster, which may be why the peer does not answer.
void connection::on_unanswered(bool lost) {
    const auto keep = shared_from_this();
    if (const auto& secured = host_->node().secured; secured && from_ == origin::dialled) {
        secured->on_unanswered(peer().name);
    }
    if (lost) {
        abandon(peer().name + " does not answer at " + peer().address +
                ": it is not there, or this node is not in its roster");
    }
}

// -- from the session ----------------------------------------------------------------------------------------------

void connection::wake() {
    if (node_there_ && !node_there_->is_watched()) {
        node_there_->watch(host_->now());
    }
    if (!now_) { // during a batch, `on_batch` flushes
        host_->flush_scheduler().flush_soon(*this);
    }
}

bool connection::is_behind() const { return link_->unsent() > host_->bounds().unread; }

void connection::pause(bool stop) {
    pause_for_queue_ = stop;
    link_->pause(pause_for_queue_ || pause_for_backlog_);
}

void connection::finish() {
    usable_ = false;
    finished_ = true;
    if (monitor_) {
        monitor_->stop();
    }
    if (node_there_) {
        node_there_->stop();
    }
    link_->finish();
}

void connection::close() {
    if (!gone_) {
        send_output(); // send the replies to earlier requests
    }
    abandon("the link was closed");
}

bool connection::takes_updates() const {
    // If nothing is pending, one update is always accepted: no later event would ask for it again.
    const auto unsent = link_->unsent();
    const bool takes = unsent < update_backpressure_limit && (unsent == 0 || memory_->has_capacity(unsent));
    updates_wait_ = updates_wait_ || !takes;
    return takes;
}

void connection::put_updates(std::string_view lines) {
    if (datagrams_) {
        datagrams_->append_updates(link_->output(), lines);
    } else {
        link_->output().append(lines);
    }
    host_->flush_scheduler().flush_soon(*this);
}

// A bridge has bound it for one requester of other pools, and has to drop that one. For others, this node goes on
// trying.
void connection::on_denied() {
    if (peer().transport == "pool") {
        host_->post_while_running([weak = weak_from_this()](local_node&) {
            if (const auto self = weak.lock()) {
                self->close();
            }
        });
    }
}

// -- output --------------------------------------------------------------------------------------------------------

void connection::flush() {
    if (gone_) {
        return;
    }
    serve_more();
    if (gone_) { // a handler ended it
        return;
    }
    send_output();
    update_backpressure();
    if (may_serve_more()) {
        host_->flush_scheduler().flush_soon(*this);
    }
    if (updates_wait_ && !host_->stopped() && link_->unsent() < update_backpressure_limit) {
        // The link sent everything at once, so it will not call `on_writable`.
        updates_wait_ = false;
        session_.serving().drain(host_->now());
    }
}

bool connection::write() {
    if (gone_) {
        return true;
    }
    send_output();
    update_backpressure();
    return !updates_wait_ && !may_serve_more();
}

void connection::send_output() {
    if (datagrams_) {
        datagrams_->limit(link_->output(), now_ ? *now_ : host_->now());
    }
    link_->flush();
}

bool connection::may_serve_more() {
    return session_.serving().has_more() && !host_->stopped() && link_->unsent() < host_->bounds().unread;
}

void connection::serve_more() {
    if (may_serve_more()) {
        const auto keep = shared_from_this();
        session_.serving().serve_more(host_->now());
    }
}

// Stops reading from a peer that does not read its replies, and watches for one that takes nothing for too long.
void connection::update_backpressure() {
    const auto unsent = link_->unsent();
    held_output_.resize(unsent + session_.asking().held_bytes());
    const auto& bounds = host_->bounds();
    const bool too_much = unsent > (pause_for_backlog_ ? bounds.unread / 2 : bounds.unread);
    if (too_much != pause_for_backlog_) {
        pause_for_backlog_ = too_much;
        link_->pause(pause_for_queue_ || pause_for_backlog_);
    }
    if (unsent != 0 && !stall_.armed()) {
        stall_.moved = link_->sent();
        host_->deadlines().arm(stall_, saturating_add(host_->now(), bounds.stall));
    }
    schedule_buffer_release();
}

// Most links are idle most of the time: the buffers of a large message are released if no other follows soon.
void connection::schedule_buffer_release() {
    if (!idle_.armed() && link_->buffered() > idle_buffer_limit) {
        idle_.moved = link_->received() + link_->sent();
        host_->deadlines().arm(idle_, host_->now() + idle_after);
    }
}

void connection::on_idle(time_point now) {
    const auto moved = link_->received() + link_->sent();
    if (std::exchange(idle_.moved, moved) == moved) {
        link_->shrink();
    } else {
        host_->deadlines().arm(idle_, now + idle_after);
    }
}

void connection::on_stall(time_point now) {
    const auto keep = shared_from_this();
    if (gone_ || link_->unsent() == 0) {
        return;
    }
    if (link_->sent() != stall_.moved) {
        stall_.moved = link_->sent();
        host_->deadlines().arm(stall_, saturating_add(now, host_->bounds().stall));
        return;
    }
    log_closed(log_level::warning, "stalled", "closed a link whose peer reads nothing");
    abandon("the peer read nothing for too long");
}

void connection::log_closed(log_level level, std::string_view kind, std::string_view what) {
    const auto& peer = link_->peer();
    host_->node().log_caused({.level = level, .kind = kind, .source = holder_of(peer), .peer = peer.address, .most = 8},
                             [&] { return std::string{what}.append(": ").append(peer.address); });
}

void connection::on_silence() {
    const auto keep = shared_from_this();
    if (datagrams_) {
        abandon("nothing was received for too long");
        return;
    }
    log_closed(log_level::debug, "silent", "closed a link on which no line was received");
    close_after_flush("no line was received in time");
}

// Output that is pending anyway also shows whether the peer exists.
void connection::on_probe() {
    if (!gone_ && link_->unsent() == 0) {
        link_->output().push_back('\n');
        send_output();
        update_backpressure();
    }
}

// -- the node at the other end -------------------------------------------------------------------------------------

// Another service of this process hangs with this one. What a member may not ask, it does not ask by itself.
bool connection::is_node() const {
    const auto& who = link_->peer();
    if (who.transport == "inproc") {
        return false;
    }
    if (!who.name.empty()) {
        return permits(host_->node(), {.requester = host_->node().name}, who.name, verb::pull, "cles");
    }
    const auto channel = channel_.lock();
    return channel && channel->leads_to_known_node();
}

bool connection::awaits_peer() const {
    return !feeds_.empty() || !waiting_.empty() || session_.asking().in_flight() > questions_;
}

link_traffic connection::traffic() const {
    return {.received = link_->received(),
            .sent = link_->sent(),
            .unsent = link_->unsent(),
            .reads = !pause_for_queue_ && !pause_for_backlog_};
}

void connection::ask_peer() {
    const auto now = host_->now();
    ++questions_;
    session_.asking().send({.verb = verb::pull, .noun = "self:cles", .id = host_->draw_id()},
                           saturating_add(now, time_limit({}, verb::pull)), now,
                           detail::pending_ptr{new peer_reply{[weak = weak_from_this()](const peer_answer& found) {
                                                                  if (const auto self = weak.lock()) {
                                                                      self->on_answer(found);
                                                                  }
                                                              },
                                                              true}});
}

void connection::learn() {
    node_there_->learn();
    if (node_there_->is_learning() && !is_datagram()) {
        session_.asking().hold();
    }
}

void connection::prepare_to_forward() {
    if (node_there_ && !is_datagram() && description() == nullptr && !node_there_->is_learning() && is_node()) {
        learn();
    }
}

void connection::await_description(std::function<void(const peer_answer&)> then) {
    waiting_.push_back(std::move(then));
    learn();
}

// Answers to the program's own requests count too.
void connection::on_described(std::string_view json) {
    if (!node_there_) {
        return;
    }
    const auto keep = shared_from_this();
    node_there_->on_described(peer_description::read(json));
    const auto& found = node_there_->description();
    session_.asking().release(found.node, found.line);
    tell_waiting({.json = json});
}

// An answer that is no failure has been passed to `on_described`.
void connection::on_answer(const peer_answer& found) {
    --questions_;
    if (found.code && node_there_->is_learning()) {
        node_there_->on_undescribed();
        session_.asking().release();
        tell_waiting(found);
    }
}

void connection::tell_waiting(const peer_answer& found) {
    const auto waiting = std::exchange(waiting_, {});
    for (const auto& then : waiting) {
        then(found);
    }
}

void connection::on_hung() {
    const auto keep = shared_from_this();
    const auto silence = std::to_string(host_->bounds().silence.count());
    abandon("the node there has been silent for " + silence + " ms, and did not answer whether it is alive");
}

// -- feeds ---------------------------------------------------------------------------------------------------------

void connection::bind(feed_machine& feed, protocol::outgoing_request request, time_point deadline,
                      detail::pending_ptr operation) {
    session_.bound().add(feed);
    feeds_.push_back(&feed);
    session_.asking().send(request, deadline, host_->now(), std::move(operation));
}

void connection::unbind(feed_machine& feed) {
    session_.bound().remove(feed);
    std::erase(feeds_, &feed);
}

void connection::lose_feeds(std::string_view why) {
    const std::string reason{why};
    const auto at = host_->now();
    while (!feeds_.empty()) {
        auto* feed = feeds_.back();
        unbind(*feed);
        feed->on_lost(reason, at);
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

// A peer that has sent nothing gets the same reply as a refused one: its first request may be on its way.
void connection::evict() {
    ++host_->node().counts.links_evicted;
    if (!monitor_->has_received()) {
        append_link_refusal(link_->output(), host_->node());
    }
    close_after_flush("evicted, because the limit of links was reached");
}

// Ends the connection now; the link sends its output and takes its time to close.
void connection::close_after_flush(std::string_view why) {
    if (!gone_) {
        const auto keep = shared_from_this();
        host_->connections().close_gracefully(link_);
        end(why);
    }
}

void connection::abandon(std::string_view why) {
    if (!gone_) {
        const auto keep = shared_from_this();
        link_->close();
        end(why);
    }
}

void connection::end(std::string_view why) {
    if (gone_) {
        return;
    }
    const auto keep = shared_from_this();
    gone_ = true;
    usable_ = false;
    host_->deadlines().disarm(stall_);
    host_->deadlines().disarm(idle_);
    if (monitor_) {
        monitor_->stop();
    }
    if (node_there_) {
        node_there_->stop();
    }
    held_output_.resize(0);
    host_->connections().forget(*this, link_->received(), link_->sent());
    lose_feeds(why);
    session_.on_lost(why);
    if (node_there_) {
        node_there_->stop(); // those that were told may have sent something
    }
    now_.reset();
    host_->check_shutdown();
}

} // namespace cles::core
