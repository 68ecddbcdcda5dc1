// SPDX-License-Identifier: BSL-1.0
#include "simulation/connection.hpp"

#include "simulation/node_run.hpp"

#include <utility>

namespace cles::simulation {
namespace {

constexpr unsigned lines_per_write = 32;
constexpr std::size_t udp_over_v4 = 28;
constexpr std::size_t updates_wait_past = 65536;

} // namespace

connection::connection(node_run& host, link_ptr carrier, origin from)
    : node_(host), link_(std::move(carrier)), from_(from), session_(host.node(), *this, *this, link_->peer()),
      stall_(*this) {
    if (link_->datagram() == 0) {
        return;
    }
    const bool stranger = from_ != origin::dialled && !link_->peer().local;
    datagrams_.emplace(*host.node(), link_->datagram(), stranger ? link_->peer().address : std::string{}, udp_over_v4);
    if (from_ == origin::accepted && host.fault() != planted::source_kept) {
        life_.emplace(static_cast<core::source_life::keeper&>(*this), host.node()->deadlines, host.now());
    }
}

connection::~connection() = default;

// -- from the link -------------------------------------------------------------------------------------------------

bool connection::hears(std::string_view text) {
    if (from_ == origin::refused) {
        session_.turn_away(text);
        return false;
    }
    if (life_) {
        life_->heard(node_.now());
    }
    return true;
}

void connection::on_line(std::string_view line) {
    in_batch_ = true;
    node_.watcher().saw(node_.name(), "<--", line);
    if (!hears(line)) {
        return;
    }
    session_.on_line(line, node_.now());
    if (++lines_ % lines_per_write == 0 || link_->output().size() > node_.bounds().unread) {
        flush();
    }
}

void connection::on_overlong(std::string_view head) {
    in_batch_ = true;
    if (!hears(head)) {
        return;
    }
    session_.on_overlong(head, node_.now());
}

void connection::on_cut(std::string_view rest) {
    in_batch_ = true;
    session_.on_cut(rest, node_.now());
}

void connection::on_batch() {
    const auto keep = shared_from_this();
    flush();
    lines_ = 0;
    in_batch_ = false;
    if (from_ == origin::refused) {
        abandon("there are as many links as there may be");
    }
}

void connection::on_end() {
    in_batch_ = true;
    usable_ = false;
    lose_feeds("the publisher ended the link");
    session_.on_end(node_.now());
}

void connection::on_lost(boost::system::error_code why) { end("the link was lost: " + why.message()); }

void connection::on_room() {
    const auto keep = shared_from_this();
    session_.serving().drain(node_.now());
    flush();
}

// -- from the session ----------------------------------------------------------------------------------------------

void connection::wake() {
    if (!in_batch_) {
        node_.turns().flush_soon(*this);
    }
}

bool connection::is_behind() const { return link_->unsent() > node_.bounds().unread; }

void connection::pause(bool stop) {
    pause_for_queue_ = stop;
    link_->pause(pause_for_queue_ || pause_for_backlog_);
}

void connection::finish() {
    usable_ = false;
    link_->finish();
}

void connection::close() {
    if (!gone_) {
        send_output();
    }
    abandon("the link was closed");
}

bool connection::takes_updates() const {
    const bool takes = link_->unsent() < updates_wait_past || node_.fault() == planted::never_full;
    updates_wait_ = updates_wait_ || !takes;
    return takes;
}

void connection::put_updates(std::string_view lines) {
    if (datagrams_) {
        datagrams_->append_updates(link_->output(), lines);
    } else {
        link_->output().append(lines);
    }
    node_.turns().flush_soon(*this);
}

// -- output --------------------------------------------------------------------------------------------------------

void connection::flush() {
    if (gone_) {
        return;
    }
    if (may_serve_more()) {
        const auto keep = shared_from_this();
        session_.serving().serve_more(node_.now());
    }
    send_output();
    follow_backlog();
    if (may_serve_more()) {
        node_.turns().flush_soon(*this);
    }
    if (updates_wait_ && link_->unsent() < updates_wait_past) {
        updates_wait_ = false;
        session_.serving().drain(node_.now());
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
        datagrams_->limit(link_->output(), node_.now());
    }
    link_->flush();
}

bool connection::may_serve_more() { return session_.serving().has_more() && link_->unsent() < node_.bounds().unread; }

void connection::follow_backlog() {
    const auto unsent = link_->unsent();
    const auto& bounds = node_.bounds();
    const bool too_much = unsent > (pause_for_backlog_ ? bounds.unread / 2 : bounds.unread);
    if (too_much != pause_for_backlog_) {
        pause_for_backlog_ = too_much;
        link_->pause(pause_for_queue_ || pause_for_backlog_);
    }
    if (unsent != 0 && !stall_.armed()) {
        stall_.sent = link_->sent();
        node_.node()->deadlines.arm(stall_, node_.now() + bounds.stall);
    }
}

void connection::on_stall(time_point now) {
    if (gone_ || link_->unsent() == 0) {
        return;
    }
    if (link_->sent() != stall_.sent) {
        stall_.sent = link_->sent();
        node_.node()->deadlines.arm(stall_, now + node_.bounds().stall);
        return;
    }
    abandon("the peer took nothing for too long");
}

// -- feeds ---------------------------------------------------------------------------------------------------------

void connection::bind(core::feed_machine& feed, protocol::request_text request, time_point deadline,
                      detail::pending_ptr operation) {
    session_.bound().add(feed);
    feeds_.push_back(&feed);
    session_.asking().send(request, deadline, node_.now(), std::move(operation));
}

void connection::unbind(core::feed_machine& feed) {
    session_.bound().remove(feed);
    std::erase(feeds_, &feed);
}

void connection::lose_feeds(std::string_view why) {
    const std::string reason{why};
    while (!feeds_.empty()) {
        auto* feed = feeds_.back();
        unbind(*feed);
        feed->on_lost(reason, node_.now());
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

void connection::abandon(std::string_view why) {
    if (!gone_) {
        const auto keep = shared_from_this();
        link_->close();
        end(why);
    }
}

void connection::vanish() {
    gone_ = true;
    usable_ = false;
    link_->output().clear();
    link_->close();
}

void connection::end(std::string_view why) {
    if (gone_) {
        return;
    }
    const auto keep = shared_from_this();
    gone_ = true;
    usable_ = false;
    node_.node()->deadlines.disarm(stall_);
    life_.reset();
    node_.forget(*this);
    lose_feeds(why);
    session_.on_lost(why);
    in_batch_ = false;
}

} // namespace cles::simulation
