// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/feed.hpp>
#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/multicast.hpp>
#include <cles/paper.hpp>
#include <cles/service.hpp>

#include "api/linked_security.hpp"
#include "node/session/task_execution.hpp"
#include "port/group_port.hpp"
#include "protocol/request_line.hpp"
#include "transport/ip_interface.hpp"

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/json/value.hpp>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <functional>
#include <future>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace cles::paper {
namespace asio = boost::asio;

namespace {

/// Of a command: JSON, or why it failed. As a value, because an exception would belong to two threads.
struct outcome {
    std::string json{};
    boost::system::error_code code{};
    std::string why{};
};
using reply_promise = std::shared_ptr<std::promise<outcome>>;

std::string variable(const char* name) {
    const char* value = std::getenv(name);
    return value == nullptr ? std::string{} : std::string{value};
}

std::string url_text(const char* scheme, const std::string& interface, std::uint16_t port) {
    std::string host = interface;
    for (const auto& each : transport::interfaces_of_host()) {
        if (each.name == interface && each.address != 0) {
            host = core::host_text({.address = each.address});
        }
    }
    if (host.find(':') != std::string::npos && !host.starts_with('[')) {
        host.insert(0, "[").push_back(']'); // IPv6
    }
    return std::string{scheme} + "://" + host + ":" + std::to_string(port);
}

multicast_options group(const char* otherwise) {
    if (const auto chosen = variable("CLES_MULTICAST"); !chosen.empty()) {
        return parse_multicast(chosen);
    }
    multicast_options out{.interface = otherwise};
    out.required = false;
    return out;
}

void fail(const reply_promise& reply, boost::system::error_code code, const std::string& why) {
    reply->set_value({.code = code, .why = why});
}

// Sets the reply when a request completes.
auto into(const reply_promise& reply, const std::shared_ptr<std::string>& why) {
    return [reply, why](boost::system::error_code code, json_text answer) {
        if (code) {
            fail(reply, code, *why);
        } else {
            reply->set_value({.json = std::move(answer.text)});
        }
    };
}

bind_options options_of(const protocol::request_line& bind) {
    bind_options out;
    out.every(std::chrono::milliseconds{bind.every_ms}).hops(bind.hops);
    out.deadline(std::chrono::milliseconds{bind.deadline_ms});
    if (bind.keep != protocol::default_keep) {
        out.keep(bind.keep);
    }
    return out;
}

/// A binding of a noun.
struct binding {
    std::string task;
    std::vector<std::string> parameters;
    feed<json_text> updates;
};

} // namespace

/// All but `turn` and what it guards is used by the thread of the service, or by the one that has `turn` before `run`.
struct CLES_Service::parts {
    asio::io_context io{1};
    std::optional<asio::executor_work_guard<asio::io_context::executor_type>> work{io.get_executor()};
    std::unique_ptr<service> node{};
    std::map<std::string, plain_handler, std::less<>> on_update{};
    std::map<std::string, std::shared_ptr<binding>, std::less<>> bound{}; // by noun
    identity publisher{};                                                 // of updates: the feed has checked it

    std::mutex turn;
    std::atomic<bool> stopping = false; // set with `turn`, or by a function of the service
    std::thread thread;
    std::mutex ending; // held by who stops it, so that another who stops it waits, too

    [[nodiscard]] bool is_inside() noexcept { return io.get_executor().running_in_this_thread(); }

    void send(const std::string& command, const reply_promise& reply);
    void bind(const protocol::request_line& r, const reply_promise& reply);
    void follow(const std::shared_ptr<binding>& from);
    void deliver(const binding& from, std::string_view body);
};

void CLES_Service::parts::send(const std::string& command, const reply_promise& reply) {
    protocol::request_line r;
    protocol::malformed_request wrong;
    const bool valid = protocol::parse_request(command, r, wrong);
    if (valid && r.verb == verb::bind) {
        bind(r, reply);
        return;
    }
    const bool own = valid && (r.noun.target == "self" || r.noun.target == node->name());
    if (own && r.verb == verb::update && !r.is_update() && !on_update.contains(r.noun.task)) {
        // Only this program may publish, so that there is no handler for the requests of others.
        try {
            std::string scratch;
            node->update(protocol::canonical_path(r.noun, scratch),
                         json_text{r.body.empty() ? "{}" : std::string{r.body}});
            reply->set_value({.json = "{}"});
        } catch (const error& e) {
            fail(reply, e.code(), e.message());
        } catch (const std::exception& e) {
            fail(reply, errc::failed, e.what());
        }
        return;
    }
    const auto why = std::make_shared<std::string>();
    node->async_request(command, call_options{}.diagnostics(*why), into(reply, why));
}

void CLES_Service::parts::bind(const protocol::request_line& r, const reply_promise& reply) {
    std::string scratch;
    const auto noun = std::string{r.noun.target} + ":" + std::string{protocol::canonical_path(r.noun, scratch)};
    if (r.unbinds()) {
        bound.erase(noun);
        reply->set_value({.json = "{}"});
        return;
    }
    const auto made = std::make_shared<binding>();
    made->task = r.noun.task;
    if (!on_update.contains(made->task)) {
        fail(reply, errc::bad_request,
             "no function takes the updates of '" + made->task + "': call registerUpdateFunction first");
        return;
    }
    for (const auto each : core::decode(r.noun, scratch)) {
        made->parameters.emplace_back(each);
    }
    const auto why = std::make_shared<std::string>();
    node->async_bind(noun, options_of(r).diagnostics(*why),
                     [this, noun, made, reply, why](boost::system::error_code code, feed<json_text> updates) {
                         if (code) {
                             fail(reply, code, *why);
                             return;
                         }
                         made->updates = std::move(updates);
                         bound.insert_or_assign(noun, made);
                         follow(made);
                         reply->set_value({.json = "{}"});
                     });
}

void CLES_Service::parts::follow(const std::shared_ptr<binding>& from) {
    from->updates.async_next(
        [this, weak = std::weak_ptr{from}](boost::system::error_code code, const feed_item<json_text>& item) {
            const auto alive = weak.lock();
            if (code || !alive) {
                return;
            }
            if (item.has_value()) {
                deliver(*alive, item.value.text);
            }
            follow(alive);
        });
}

void CLES_Service::parts::deliver(const binding& from, std::string_view body) {
    const std::vector<std::string_view> parameters(from.parameters.begin(), from.parameters.end());
    const cles::detail::request_data data{.verb = verb::update,
                                          .node = node->name(),
                                          .task = from.task,
                                          .parameters = parameters,
                                          .body = body,
                                          .peer = &publisher};
    std::string ignored;
    json_writer result{ignored};
    try {
        on_update.find(from.task)->second(request{data}, result);
    } catch (...) { // NOLINT(bugprone-empty-catch): nobody has asked, so nobody can be told
    }
}

// -- the interface of the listing ------------------------------------------------------------------------------------

CLES_Service::CLES_Service(const std::string& deviceName, const std::string& interface, std::uint16_t port)
    : parts_(std::make_unique<parts>()) {
    const auto make = [&](service_options options) {
        options.limits.silence = std::chrono::milliseconds{0}; // others of this interface run one function at a time
        parts_->node = std::make_unique<service>(parts_->io, options);
    };
    try {
        make({.name = deviceName, .listen = {url_text("tcp", interface, port)}, .multicast = group("lo")});
    } catch (const error& refused) {
        const auto keys = variable("CLES_KEYS");
        if (refused.code() != errc::insecure_listen || keys.empty()) {
            throw;
        }
        if (cles::detail::linked_security == nullptr) {
            throw error(errc::insecure_listen, refused.message() + "; for the keys in CLES_KEYS, link cles::tls");
        }
        make({.name = deviceName,
              .listen = {url_text("tls", interface, port)},
              .security = cles::detail::linked_security(keys.c_str()),
              .multicast = group("auto")});
    }
}

CLES_Service::~CLES_Service() { stop(); }

service& CLES_Service::native() noexcept { return *parts_->node; }

bool CLES_Service::add(verb how, std::string_view task, plain_handler function) {
    auto& all = *parts_;
    std::packaged_task<bool()> add_it{[&] {
        try {
            all.node->add({.verb = how, .task = std::string{task}, .plain = function});
        } catch (const error&) {
            return false;
        }
        if (how == verb::update) {
            all.on_update.insert_or_assign(std::string{task}, std::move(function));
        }
        return true;
    }};
    auto added = add_it.get_future();
    if (all.is_inside()) {
        add_it();
        return added.get();
    }
    std::unique_lock lock{all.turn};
    if (all.stopping) {
        return false;
    }
    if (all.thread.joinable()) {
        asio::post(all.io, std::move(add_it));
        lock.unlock();
    } else {
        add_it();
    }
    return added.get();
}

void CLES_Service::run() {
    if (parts_->is_inside()) { // it runs, perhaps in a request that has `turn`
        return;
    }
    const std::scoped_lock lock{parts_->turn};
    if (parts_->stopping) {
        throw error(errc::stopped, "the service has been stopped, and does not run again");
    }
    if (!parts_->thread.joinable()) {
        parts_->thread = std::thread{[this] { parts_->io.run(); }};
    }
}

// What was posted before the thread ends still runs: the work is given up with `turn`, behind which nothing is posted.
void CLES_Service::stop() {
    auto& all = *parts_;
    if (all.is_inside()) {
        all.stopping = true;
        all.node->stop();
        return;
    }
    const std::scoped_lock one_at_a_time{all.ending};
    std::unique_lock lock{all.turn};
    all.stopping = true;
    auto thread = std::move(all.thread);
    if (thread.joinable()) {
        asio::post(all.io, [&all] { all.node->stop(); });
    } else {
        all.node->stop();
    }
    all.work.reset();
    lock.unlock();
    if (thread.joinable()) {
        thread.join();
    }
}

CLES_Response CLES_Service::makeCLESRequest(const CLES_Request& request) {
    auto& all = *parts_;
    if (all.is_inside()) {
        throw error(errc::would_deadlock,
                    "a function of the service cannot wait for a reply, which its thread receives");
    }
    const auto reply = std::make_shared<std::promise<outcome>>();
    auto answer = reply->get_future();
    {
        const std::scoped_lock lock{all.turn};
        if (all.stopping) {
            throw error(errc::stopped, "the service has been stopped");
        }
        asio::post(all.io, [&all, request, reply] { all.send(request, reply); });
        while (!all.thread.joinable() && answer.wait_for(std::chrono::seconds{0}) != std::future_status::ready) {
            all.io.run_one();
        }
    }
    const auto got = answer.get();
    if (got.code) {
        throw error(got.code, got.why);
    }
    return pairs_of(got.json);
}

CLES_Response CLES_Service::pairs_of(std::string_view json) {
    boost::json::value value;
    std::string why;
    if (!cles::from_json(json, value, &why)) {
        throw error(errc::conversion, why);
    }
    if (auto* pairs = value.if_object()) {
        return std::move(*pairs);
    }
    return {{"value", std::move(value)}};
}

} // namespace cles::paper
