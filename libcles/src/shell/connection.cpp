// SPDX-License-Identifier: BSL-1.0
#include "shell/connection.hpp"

#include "core/feed_machine.hpp"
#include "core/later.hpp"
#include "shell/local_node.hpp"

#include <chrono>
#include <utility>

namespace cles::shell {
namespace {

constexpr unsigned lines_per_write = 32;
constexpr std::size_t udp_over_v4 = 28; // bytes of headers
constexpr std::size_t udp_over_v6 = 48;
constexpr std::size_t updates_wait_past = 65536; // unsent bytes past which updates stay in their topics
constexpr std::size_t modest_buffers = 32768;    // bytes that an idle link may keep
constexpr std::chrono::seconds idle_after{2};

} // namespace

connection::connection(std::shared_ptr<local_node> host, link_ptr carrier, origin from, std::uint64_t number)
    : host_(std::move(host)), link_(std::move(carrier)), from_(from), number_(number),
      memory_(std::make_shared<core::memory_account>(host_->node().memory)),
      session_(host_->shared_node(), *this, *this, link_->peer()), stall_(*this), idle_(*this) {
    if (link_->datagram() == 0) {
        monitor_.emplace(static_cast<core::link_monitor::owner&>(*this), host_->deadlines(), host_->bounds(),
                         host_->now());
        if (from_ == origin::accepted) {
            monitor_->expect_line();
        }
        return;
    }
    const bool came_in = from_ == origin::accepted || from_ == origin::refused;
    const auto stranger = came_in ? host_->stranger(link_->peer()) : std::string{};
    const bool is_v6 = stranger.find(':') != std::string::npos;
    datagrams_.emplace(host_->node(), link_->datagram(), stranger, is_v6 ? udp_over_v6 : udp_over_v4);
    if (from_ == origin::accepted) {
        life_.emplace(static_cast<core::source_life::keeper&>(*this), host_->deadlines(), host_->now());
    }
}

connection::~connection() = default;

void connection::start() { link_->start(shared_from_this()); }

time_point connection::now() { return now_ ? *now_ : *(now_ = host_->now()); }

// -- from the link -------------------------------------------------------------------------------------------------

bool connection::hears(std::string_view text) {
    if (from_ == origin::refused) {
        session_.turn_away(text);
        return false;
    }
    if (life_) {
        life_->heard(now());
    } else if (monitor_ && !text.empty()) {
        monitor_->on_line(now());
    }
    return true;
}

void connection::on_line(std::string_view line) {
    if (!hears(line)) {
        return;
    }
    session_.on_line(line, now());
    // In a long batch the peer gets to work on the first replies while the rest is still being answered: with many
    // requests in flight, neither end then waits for the other.
    if (++lines_ % lines_per_write == 0 || link_->output().size() > host_->bounds().unread) {
        flush();
    }
    throw_on();
}

// What a handler has thrown, past the link: which hands the other lines over later, and may not end this batch.
void connection::throw_on() {
    if (host_->completions().has_thrown()) {
        const auto keep = shared_from_this();
        now_.reset();
        host_->turns().flush_soon(*this);
        host_->settle();
        host_->completions().rethrow();
    }
}

void connection::on_overlong(std::string_view head) {
    if (!hears(head)) {
        return;
    }
    session_.on_overlong(head, now());
}

void connection::on_cut(std::string_view rest) { session_.on_cut(rest, now()); }

void connection::on_batch() {
    const auto keep = shared_from_this();
    flush();
    lines_ = 0;
    now_.reset();
    host_->settle();
    if (from_ == origin::refused) {
        abandon("there are as many links as there may be");
    }
}

void connection::on_end() {
    usable_ = false;
    lose_feeds("the publisher ended the link");
    session_.on_end(now());
    if (monitor_ && !finished_ && !gone_) {
        monitor_->on_end(now());
    }
}

void connection::on_lost(boost::system::error_code why) {
    host_->connections().seen_off(*link_);
    end("the link was lost: " + why.message());
}

void connection::on_room() {
    const auto keep = shared_from_this();
    session_.serving().drain(host_->now());
    flush();
    host_->settle();
}

// -- from the session ----------------------------------------------------------------------------------------------

void connection::wake() {
    if (!now_) { // else the batch ends with a flush
        host_->turns().flush_soon(*this);
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
    link_->finish();
}

void connection::close() {
    if (!gone_) {
        send_output(); // what was asked before is answered
    }
    abandon("the link was closed");
}

bool connection::takes_updates() const {
    // Where nothing waits one more always goes: nothing else would ask for it again.
    const auto unsent = link_->unsent();
    const bool takes = unsent < updates_wait_past && (unsent == 0 || memory_->has_room(unsent));
    updates_wait_ = updates_wait_ || !takes;
    return takes;
}

void connection::put_updates(std::string_view lines) {
    if (datagrams_) {
        datagrams_->append_updates(link_->output(), lines);
    } else {
        link_->output().append(lines);
    }
    host_->turns().flush_soon(*this);
}

// -- output --------------------------------------------------------------------------------------------------------

void connection::flush() {
    if (gone_) {
        return;
    }
    serve_more();
    if (gone_) { // by a handler
        return;
    }
    send_output();
    follow_backlog();
    if (may_serve_more()) {
        host_->turns().flush_soon(*this);
    }
    if (updates_wait_ && !host_->stopped() && link_->unsent() < updates_wait_past) {
        // The link took all at once, and so will not say that it has room.
        updates_wait_ = false;
        session_.serving().drain(host_->now());
    }
}

bool connection::write() {
    if (gone_) {
        return true;
    }
    send_output();
    follow_backlog();
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

// A peer that does not read its replies is not read from either; one that takes nothing for long is left.
void connection::follow_backlog() {
    const auto unsent = link_->unsent();
    held_output_.resize(unsent);
    const auto& bounds = host_->bounds();
    const bool too_much = unsent > (pause_for_backlog_ ? bounds.unread / 2 : bounds.unread);
    if (too_much != pause_for_backlog_) {
        pause_for_backlog_ = too_much;
        link_->pause(pause_for_queue_ || pause_for_backlog_);
    }
    if (unsent != 0 && !stall_.armed()) {
        stall_.sent = link_->sent();
        host_->deadlines().arm(stall_, core::later(host_->now(), bounds.stall));
    }
    follow_buffers();
}

// Many links are idle most of the time: what a large message took is given back when no other follows it soon.
void connection::follow_buffers() {
    if (!idle_.armed() && link_->buffered() > modest_buffers) {
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
    if (link_->sent() != stall_.sent) {
        stall_.sent = link_->sent();
        host_->deadlines().arm(stall_, core::later(now, host_->bounds().stall));
        return;
    }
    host_->say_soon(log_level::warning, "closed a link whose peer takes nothing: " + link_->peer().address,
                    link_->peer().address);
    abandon("the peer took nothing for too long");
}

// A source of datagrams that has nothing more to say.
void connection::on_quiet() { abandon("nothing came for a while"); }

void connection::on_silence() {
    const auto keep = shared_from_this();
    host_->say_soon(log_level::debug, "closed a link that brought no line: " + link_->peer().address,
                    link_->peer().address);
    part("no line came in time");
}

// Where something is being written anyway, that shows as well whether the peer is there.
void connection::on_probe() {
    if (!gone_ && link_->unsent() == 0) {
        link_->output().push_back('\n');
        send_output();
        follow_backlog();
    }
}

// -- feeds ---------------------------------------------------------------------------------------------------------

void connection::bind(core::feed_machine& feed, protocol::request_text request, time_point deadline,
                      detail::pending_ptr operation) {
    session_.bound().add(feed);
    feeds_.push_back(&feed);
    session_.asking().send(request, deadline, host_->now(), std::move(operation));
}

void connection::unbind(core::feed_machine& feed) {
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

// A silent peer gets the answer that a refused one gets: its first request may be on its way.
void connection::give_way() {
    ++host_->node().counts.links_evicted;
    if (!monitor_->has_spoken()) {
        session_.say_busy();
    }
    part("others needed the room");
}

// Ends it with what is written, while the link itself takes its time to close.
void connection::part(std::string_view why) {
    if (!gone_) {
        const auto keep = shared_from_this();
        host_->connections().see_off(link_);
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
    life_.reset();
    if (monitor_) {
        monitor_->stop();
    }
    held_output_.resize(0);
    host_->forget(*this, link_->received(), link_->sent());
    lose_feeds(why);
    session_.on_lost(why);
    now_.reset();
    host_->settle();
}

} // namespace cles::shell
