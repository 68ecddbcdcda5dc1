// SPDX-License-Identifier: BSL-1.0
#include "daemon/signals.hpp"

#include <csignal>
#include <utility>

namespace cles::runtime {

signals::signals(const boost::asio::any_io_executor& executor, std::function<void(int)> on_stop,
                 std::function<void()> on_reload)
    : set_(executor, SIGTERM, SIGINT, SIGHUP), on_stop_(std::move(on_stop)), on_reload_(std::move(on_reload)) {
    wait();
}

void signals::close() { set_.cancel(); }

void signals::wait() {
    set_.async_wait([this](boost::system::error_code code, int number) {
        if (code) {
            return;
        }
        wait(); // first, for what is called may close
        if (number == SIGHUP) {
            on_reload_();
        } else {
            on_stop_(number);
        }
    });
}

} // namespace cles::runtime
