// SPDX-License-Identifier: BSL-1.0
#include "mission.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/read_until.hpp>

#include <charconv>
#include <cstdint>

#include <unistd.h>

// The operator at the terminal: what he is shown, and what he says.

namespace jadc2 {

// Once a second: nobody reads faster.
void mission::show() {
    if (received_utc_ - shown_utc_ < 1) {
        return;
    }
    shown_utc_ = received_utc_;
    const auto& seen = commander_.latest();
    std::string text = std::to_string(seen.tracks.size()) + " targets";
    for (const auto& t : seen.tracks) {
        text += "\n    " + std::to_string(t.id) + "  at " + fixed(t.x, 0) + ", " + fixed(t.y, 0) + ", moving " +
                fixed(t.vx, 0) + ", " + fixed(t.vy, 0) + " pixels a second, followed for " + std::to_string(t.age) +
                " frames";
    }
    tell_.tell("picture", text + "\n    strike NUMBER, or quit:", seen);
}

boost::asio::awaitable<void> mission::read_orders() {
    boost::system::error_code wrong;
    keyboard_.assign(::dup(STDIN_FILENO), wrong);
    std::string text;
    while (!ending_ && !wrong) {
        const auto [code, size] =
            co_await boost::asio::async_read_until(keyboard_, boost::asio::dynamic_buffer(text, 4096), '\n',
                                                   boost::asio::as_tuple(boost::asio::use_awaitable));
        wrong = code;
        if (!code) {
            obey(std::string_view{text}.substr(0, size - 1));
            text.erase(0, size);
        }
    }
    if (!ending_) {
        operator_gone_ = true;
        tell_.tell("operator", "the operator has gone: " + wrong.message());
        end_if_all_is_done();
    }
}

void mission::obey(std::string_view line) {
    if (line == "quit") {
        end();
        return;
    }
    constexpr std::string_view word = "strike ";
    std::uint64_t id = 0;
    const auto number = line.substr(0, word.size()) == word ? line.substr(word.size()) : std::string_view{};
    const auto [end_of_number, code] = std::from_chars(number.data(), number.data() + number.size(), id);
    if (number.empty() || code != std::errc{} || end_of_number != number.data() + number.size()) {
        tell_.tell("operator", "'" + std::string{line} + "' is no order: strike NUMBER, or quit");
    } else if (commander_.fates().given >= wanted_.strikes) {
        tell_.tell("operator", "no more orders: " + std::to_string(wanted_.strikes) + " were allowed (--strikes)");
    } else if (const auto target = commander_.find(id)) {
        decide(*target);
    } else {
        tell_.tell("operator", "there is no target " + std::to_string(id) + " now");
    }
}

} // namespace jadc2
