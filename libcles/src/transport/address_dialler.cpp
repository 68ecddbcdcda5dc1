// SPDX-License-Identifier: BSL-1.0
#include "transport/address_dialler.hpp"

#include "transport/member_handler.hpp"

#include <algorithm>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

address_dialler::address_dialler(const asio::any_io_executor& executor, const limits& bounds, error_code late,
                                 dial_callback done)
    : timeout_(executor, bounds.connect), next_(executor), late_(late), done_(std::move(done)) {}

void address_dialler::begin_race(std::size_t count, std::function<void(std::size_t)> answered) {
    answered_ = std::move(answered);
    race_ = address_race{count};
    wait_call<&address_dialler::on_timeout>(timeout_, shared_from_this());
    continue_race();
}

void address_dialler::on_timeout(error_code code) {
    if (!code) {
        fail(late_);
    }
}

void address_dialler::on_due(error_code code) {
    if (!code) {
        continue_race();
    }
}

void address_dialler::continue_race() {
    if (!done_) {
        return;
    }
    const auto keep = shared_from_this();
    const auto now = time_point::clock::now();
    const auto again = ask_again(now);
    while (done_) {
        const auto which = race_.next(time_point::clock::now()); // the last one may have failed at once
        if (!which) {
            break;
        }
        begin(*which);
    }
    const auto due = std::min(again, race_.due().value_or(time_point::max()));
    if (done_ && due != time_point::max()) {
        next_.expires_after(due - now);
        wait_call<&address_dialler::on_due>(next_, shared_from_this());
    }
}

void address_dialler::win(std::size_t which, link_ptr made) {
    const auto done = std::exchange(done_, nullptr);
    const auto answered = std::exchange(answered_, nullptr);
    give_up();
    if (answered) {
        answered(which);
    }
    if (done) {
        done({}, std::move(made));
    }
}

void address_dialler::note_failure(error_code why) {
    race_.fail(time_point::clock::now());
    if (race_.is_lost()) {
        fail(why);
    }
}

void address_dialler::note_acceptance() { race_.accept(time_point::clock::now()); }

void address_dialler::fail(error_code why) {
    const auto done = std::exchange(done_, nullptr);
    give_up();
    if (done) {
        done(why, nullptr);
    }
}

void address_dialler::give_up() {
    done_ = nullptr;
    answered_ = nullptr;
    timeout_.cancel();
    next_.cancel();
    close_attempts();
}

} // namespace cles::transport
