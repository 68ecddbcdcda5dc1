// SPDX-License-Identifier: BSL-1.0
#include "transport/udp_dialler.hpp"

#include "protocol/reply_line.hpp"
#include "transport/lookup_error.hpp"
#include "transport/udp.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

/// Receives what an address answers, until the link has its owner. It does not keep the dialler alive, which keeps the
/// link alive.
class udp_dialler::question final : public link_events {
  public:
    question(udp_dialler& owner, std::size_t which)
        : owner_(std::static_pointer_cast<udp_dialler>(owner.shared_from_this())), which_(which) {}

    void on_line(std::string_view line) override {
        protocol::reply_line reply;
        const auto owner = owner_.lock();
        if (owner && protocol::is_reply(line) && protocol::parse_reply(line, reply) && reply.id == question_id) {
            owner->on_answer(which_);
        }
    }
    void on_session() {
        if (const auto owner = owner_.lock()) {
            owner->on_answer(which_);
        }
    }
    void on_overlong(std::string_view) override {}
    void on_batch() override {}
    void on_end() override {}
    void on_lost(error_code why) override {
        if (const auto owner = owner_.lock()) {
            owner->on_failed(which_, why);
        }
    }
    void on_writable() override {}

  private:
    std::weak_ptr<udp_dialler> owner_;
    std::size_t which_;
};

udp_dialler::udp_dialler(const asio::any_io_executor& executor, const limits& bounds, udp_connector connect,
                         dial_callback done)
    : address_dialler(executor, bounds, lookup_errc::no_answer, std::move(done)), connect_(std::move(connect)) {}

void udp_dialler::start(std::vector<asio::ip::udp::endpoint> where, std::function<void(std::size_t)> answered) {
    if (where.size() == 1) {
        error_code code;
        if (auto made = connect_(where.front(), code)) {
            win(0, std::move(made));
        } else {
            fail(code);
        }
        return;
    }
    where_ = std::move(where);
    again_.emplace(time_point::clock::now());
    begin_race(where_.size(), std::move(answered));
}

time_point udp_dialler::ask_again(time_point now) {
    if (again_->next(now)) {
        for (const auto& one : std::vector{attempts_}) {
            one.link->ask();
        }
    }
    return again_->due();
}

void udp_dialler::begin(std::size_t which) {
    error_code code;
    auto link = connect_(where_[which], code);
    if (!link) {
        note_failure(code);
        return;
    }
    attempts_.push_back({which, link});
    const auto events = std::make_shared<question>(*this, which);
    link->await_session([events] { events->on_session(); });
    link->start(events);
    link->ask();
}

void udp_dialler::on_answer(std::size_t which) {
    const auto found =
        std::find_if(attempts_.begin(), attempts_.end(), [which](const attempt& one) { return one.which == which; });
    if (found == attempts_.end()) {
        return; // a second answer
    }
    auto link = std::move(found->link);
    attempts_.erase(found);
    link->await_session(nullptr);
    win(which, std::move(link));
}

void udp_dialler::on_failed(std::size_t which, error_code code) {
    std::erase_if(attempts_, [which](const attempt& one) { return one.which == which; });
    note_failure(code);
    continue_race();
}

void udp_dialler::close_attempts() {
    for (const auto& one : std::exchange(attempts_, {})) {
        one.link->close();
    }
}

} // namespace cles::transport
