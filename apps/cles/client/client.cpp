// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"

#include "client/logging.hpp"
#include "client/member_key.hpp"
#include "client/offered_tasks.hpp"
#include "client/suggestion.hpp"
#include "options/arguments.hpp"
#include "output/errors.hpp"
#include "output/json_node.hpp"
#include "output/terminal.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <map>
#include <utility>
#include <vector>

#include <unistd.h>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;

namespace {

cles::service_options options_of(const address_book& addresses, int verbosity, bool in_group) {
    addresses.check();
    cles::service_options options;
    options.name = "cles-" + std::to_string(::getpid());
    options.pool = addresses.pool();
    if (addresses.is_secured()) {
        use_member_key(options, addresses.keys(), addresses.local_users());
    }
    options.peers = addresses.peers();
    if (in_group || addresses.finds_by_name()) {
        options.multicast = addresses.group();
    }
    options.insecure = true; // it serves nothing
    options.log = make_client_log(verbosity);
    return options;
}

boost::system::error_code code_of(const std::exception_ptr& thrown) {
    if (!thrown) {
        return {};
    }
    try {
        std::rethrow_exception(thrown);
    } catch (const cles::error& e) {
        return e.code();
    } catch (...) {
        return cles::errc::failed;
    }
}

std::string without_digits(std::string_view name) {
    std::string out{name};
    std::erase_if(out, [](char c) { return c >= '0' && c <= '9'; });
    return out;
}

// The verbs of each task, from a node's answer to PULL self:cles.
std::map<std::string, std::string> verbs_by_task(const std::string& description) {
    std::map<std::string, std::string> verbs_of;
    const auto node = parse_json(description);
    for (const auto& offered : offered_tasks(node.find("tasks"))) {
        auto& verbs = verbs_of[offered.task];
        verbs.append(verbs.empty() ? "" : ", ").append(offered.verb);
    }
    return verbs_of;
}

} // namespace

client::client(const address_book& addresses, int verbosity, bool in_group)
    : addresses_(addresses), signals_(io_, SIGINT, SIGTERM), end_timer_(io_), output_timer_(io_), sleep_timer_(io_),
      node_(io_, options_of(addresses, verbosity, in_group)) {}

cles::call_options client::options_for(std::string_view noun, std::optional<std::chrono::milliseconds> limit) const {
    cles::call_options options;
    const auto target = noun.substr(0, noun.find(':'));
    if (const auto url = addresses_.url_for(target); !url.empty()) {
        options.at(url);
    } else if (target == node_.name()) { // the node whose key this is, not this command
        const auto known = endpoint_of(target);
        options.at(known.empty() ? addresses_.default_node() : known, target);
    }
    if (limit) {
        options.deadline(*limit);
    }
    return options;
}

void client::end_after(std::chrono::milliseconds limit) {
    end_timer_.expires_after(limit);
    end_timer_.async_wait([this](boost::system::error_code code) {
        if (!code && !finished_) {
            end(exit_code::success);
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
    asio::co_spawn(io_, run_explained(std::move(work)),
                   asio::bind_cancellation_slot(cancel_.slot(), [this, &thrown](std::exception_ptr failure) {
                       finished_ = true;
                       thrown = std::move(failure);
                       if (code_of(thrown) == cles::errc::no_target) {
                           suggest_node();
                           suggest_address();
                       }
                       // Cancellations of requests are still sent; nothing else is waited for.
                       node_.stop();
                       signals_.cancel();
                       end_timer_.cancel();
                       output_timer_.cancel();
                   }));
    io_.run();
    if (end_code_) {
        return *end_code_;
    }
    if (!thrown) {
        return exit_code::success;
    }
    const auto code = report_failure(thrown);
    if (!hint_.empty()) {
        note(hint_);
    }
    if (code_of(thrown).category() == cles::untrusted_listener_category()) {
        note("if that user runs the node, say which member it is: --local-user USER=MEMBER");
    }
    if (may_have_asked_secured_node(thrown)) {
        note("if security is on there, it answers only with --keys DIR at tls://, or at its Unix socket");
    }
    return code;
}

// A secured node closes a plain link, and drops plain datagrams.
bool client::may_have_asked_secured_node(const std::exception_ptr& thrown) const {
    const auto code = code_of(thrown);
    const bool lost = code == cles::errc::unavailable;
    if (addresses_.is_secured() || noun_.empty() || (!lost && code != cles::errc::deadline)) {
        return false;
    }
    return addresses_.endpoint_of(target_of(noun_)).starts_with(lost ? "tcp:" : "udp:");
}

asio::awaitable<void> client::run_explained(asio::awaitable<void> work) {
    std::exception_ptr thrown;
    try {
        co_await std::move(work);
    } catch (...) {
        thrown = std::current_exception();
    }
    if (!thrown) {
        co_return;
    }
    if (!end_code_ && code_of(thrown) == cles::errc::no_task) {
        co_await suggest_task();
    }
    std::rethrow_exception(thrown);
}

asio::awaitable<void> client::suggest_task() {
    const std::string node{target_of(noun_)};
    if (node.empty() || node == "any" || node == "all") {
        co_return;
    }
    const auto task = noun_.substr(node.size() + 1, noun_.find('/') - node.size() - 1);
    try {
        const auto options = options_for(node, 500ms);
        const cles::json_text answer = co_await node_.async_pull(node + ":cles", options);
        const auto offered = verbs_by_task(answer.text);
        std::vector<std::string> names;
        names.reserve(offered.size());
        for (const auto& [name, verbs] : offered) {
            names.push_back(name);
        }
        if (const auto match = closest_match(task, names); !match.empty()) {
            hint_ = "did you mean '" + node + ":" + match + "' (" + offered.at(match) + ")?";
        }
    } catch (const std::exception&) {
        hint_.clear(); // the original failure is reported
    }
}

void client::suggest_node() {
    std::vector<std::string> names;
    for (const auto& other : node_.peers()) {
        names.push_back(other.node);
    }
    for (const auto& [name, url] : addresses_.peers()) {
        names.push_back(name);
    }
    // car9 is another node than car1, not a mistyped one.
    const auto typed = without_digits(target_of(noun_));
    std::erase_if(names, [&](const std::string& name) { return without_digits(name) == typed; });
    if (const auto match = closest_match(target_of(noun_), names); !match.empty()) {
        hint_ = "did you mean '" + match + "'?";
    }
}

// Only what the user has not done yet: if a node has answered, an address is not what is missing.
void client::suggest_address() {
    const auto target = target_of(noun_);
    std::string hint;
    if (!addresses_.finds_by_name()) {
        const bool has_asked_another = addresses_.has_url() && !target.empty() && !stands_for_others(target);
        hint = has_asked_another ? "cles ls --at URL lists the nodes that the node there knows" : "";
    } else if (target == "any" || target == "all") {
        const auto known = node_.peers();
        const bool has_router =
            std::ranges::any_of(known, [](const cles::peer& node) { return node.load.workers != 0; });
        hint = has_router ? "" : "any: and all: need a node that routes, such as clesd; set its address with --at URL";
    } else if (endpoint_of(target).empty()) {
        hint = "cles ls lists the nodes; --at URL or --peer NAME=URL sets the address of another one";
    }
    hint_ += hint_.empty() || hint.empty() ? "" : " ";
    hint_ += hint;
}

std::string client::endpoint_of(std::string_view node) const {
    auto url = addresses_.endpoint_of(node);
    if (url.empty()) {
        for (const auto& other : node_.peers()) {
            if (other.node == node && other.state != cles::peer_state::clash && !other.endpoints.empty()) {
                url = other.endpoints.front();
            }
        }
    }
    return url;
}

void client::end(int code) {
    if (!end_code_) {
        end_code_ = code;
        cancel_.emit(asio::cancellation_type::terminal);
    }
}

void client::wait_for_signal() {
    signals_.async_wait([this](boost::system::error_code code, int signal) {
        if (code || finished_) {
            return;
        }
        if (end_code_) { // the second signal: end at once
            std::_Exit(exit_code::signalled + signal);
        }
        wait_for_signal();
        end(exit_code::signalled + signal);
    });
}

// Without this, `cles bind ... | head -1` would run until the next update.
void client::watch_output() {
    output_timer_.expires_after(250ms);
    output_timer_.async_wait([this](boost::system::error_code code) {
        if (code || finished_) {
            return;
        }
        if (is_output_closed()) {
            end(exit_code::success);
        } else {
            watch_output();
        }
    });
}

} // namespace tool
