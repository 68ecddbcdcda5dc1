// SPDX-License-Identifier: BSL-1.0
#include "client.hpp"

#include "diagnostics.hpp"
#include "exit_code.hpp"
#include "failure.hpp"
#include "logging.hpp"
#include "output.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <utility>

#include <unistd.h>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;

namespace {

cles::service_options options_of(const address_book& addresses, int verbosity, bool in_group) {
    addresses.check();
    cles::service_options options;
    options.name = "cles-" + std::to_string(::getpid());
    if (const char* pool = std::getenv("CLES_POOL"); pool != nullptr) {
        options.pool = pool;
    }
    options.peers = addresses.peers();
    if (in_group || addresses.finds_by_name()) {
        options.multicast = addresses.group();
    }
    options.insecure = true; // nothing is served here
    options.log = log_of_client(verbosity);
    return options;
}

bool is_no_target(const std::exception_ptr& thrown) {
    try {
        std::rethrow_exception(thrown);
    } catch (const cles::error& e) {
        return e.code() == cles::errc::no_target;
    } catch (...) {
        return false;
    }
}

} // namespace

client::client(const address_book& addresses, int verbosity, bool in_group)
    : addresses_(addresses), signals_(io_, SIGINT, SIGTERM), end_timer_(io_), output_timer_(io_), sleep_timer_(io_),
      node_(io_, options_of(addresses, verbosity, in_group)) {}

cles::call_options client::options_for(std::string_view noun, std::optional<std::chrono::milliseconds> limit) const {
    cles::call_options options;
    const auto url = addresses_.url_for(noun.substr(0, noun.find(':')));
    if (!url.empty()) {
        options.at(url);
    }
    if (limit) {
        options.deadline(*limit);
    }
    return options;
}

void client::end_after(std::chrono::milliseconds span) {
    end_timer_.expires_after(span);
    end_timer_.async_wait([this](boost::system::error_code code) {
        if (!code && !finished_) {
            end_early(exit_code::success);
        }
    });
}

asio::awaitable<void> client::sleep_until(std::chrono::steady_clock::time_point when) {
    sleep_timer_.expires_at(when);
    co_await sleep_timer_.async_wait(asio::use_awaitable);
}

int client::run(asio::awaitable<void> work) {
    std::exception_ptr thrown;
    wait_for_signal();
    watch_output();
    asio::co_spawn(io_, std::move(work),
                   asio::bind_cancellation_slot(cancel_.slot(), [this, &thrown](std::exception_ptr failure) {
                       finished_ = true;
                       thrown = std::move(failure);
                       // What was sent to withdraw a request still leaves; nothing else is waited for.
                       node_.stop();
                       signals_.cancel();
                       end_timer_.cancel();
                       output_timer_.cancel();
                   }));
    io_.run();
    if (early_) {
        return *early_;
    }
    if (!thrown) {
        return exit_code::success;
    }
    const auto code = report_failure(thrown);
    if (code == exit_code::not_found && addresses_.finds_by_name() && is_no_target(thrown)) {
        note("cles ls shows who is there; --at URL or --peer NAME=URL says where else to ask");
    }
    return code;
}

std::string client::where_is(std::string_view node) const {
    auto url = addresses_.where_is(node);
    if (url.empty()) {
        for (const auto& other : node_.peers()) {
            if (other.node == node && other.state != cles::peer_state::clash && !other.endpoints.empty()) {
                url = other.endpoints.front();
            }
        }
    }
    return url;
}

void client::end_early(int code) {
    if (!early_) {
        early_ = code;
        cancel_.emit(asio::cancellation_type::terminal);
    }
}

void client::wait_for_signal() {
    signals_.async_wait([this](boost::system::error_code code, int signal) {
        if (code || finished_) {
            return;
        }
        if (early_) { // asked again: there is no patience left
            std::_Exit(exit_code::signalled + signal);
        }
        wait_for_signal();
        end_early(exit_code::signalled + signal);
    });
}

// Without this, `cles bind ... | head -1` would stay until the next update.
void client::watch_output() {
    output_timer_.expires_after(250ms);
    output_timer_.async_wait([this](boost::system::error_code code) {
        if (code || finished_) {
            return;
        }
        if (is_output_closed()) {
            end_early(exit_code::success);
        } else {
            watch_output();
        }
    });
}

} // namespace tool
