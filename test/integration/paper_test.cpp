// SPDX-License-Identifier: BSL-1.0
// The paper's interface: its listing, the five verbs, and its threads.

#include <cles/paper.hpp>

#include "support/run_until.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(paper)

using cles::errc;
using texts = std::vector<std::string>;

// As in section 3.3 of the paper.
CLES_Response getSystemTime(std::vector<std::string> args) {
    CLES_Response response;
    response["systemTime"] = args.empty() ? "local" : args.front();
    return response;
}

std::string text_of(const CLES_Response& pairs) { return boost::json::serialize(pairs); }

/// What functions on other threads were given, in order.
class inbox {
  public:
    void put(std::string text) {
        const std::scoped_lock lock{mutex_};
        texts_.push_back(std::move(text));
        changed_.notify_all();
    }
    /// Waits for the next.
    std::string take() {
        std::unique_lock lock{mutex_};
        if (!changed_.wait_for(lock, cles::test::patience, [this] { return !texts_.empty(); })) {
            return "waited in vain";
        }
        auto text = std::move(texts_.front());
        texts_.pop_front();
        return text;
    }

  private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::string> texts_;
};

struct without_environment {
    without_environment() {
        ::setenv("CLES_MULTICAST", "off", 1); // other tests have devices of these names
        ::unsetenv("CLES_KEYS");
    }
};

struct devices : without_environment {
    devices() { device2.native().set_peer("device1", device1.native().endpoints().front()); }
    void run() {
        device1.run();
        device2.run();
    }
    // The pairs, or the code of the error.
    std::string ask(const CLES_Request& command) {
        try {
            return text_of(device2.makeCLESRequest(command));
        } catch (const cles::error& e) {
            return e.code().message();
        }
    }

    CLES_Service device1{"device1", "127.0.0.1", 0};
    CLES_Service device2{"device2", "lo", 0};
};

std::string message_of(errc code) { return make_error_code(code).message(); }

BOOST_FIXTURE_TEST_CASE(the_listing_runs, without_environment) {
    CLES_Service device1("device1", "127.0.0.1", 0);
    device1.registerPullFunction("systemTime", getSystemTime);
    device1.run();
    CLES_Service device2("device2", "127.0.0.1", 0);
    device2.native().set_peer("device1", device1.native().endpoints().front());
    device2.run();
    BOOST_TEST(text_of(device2.makeCLESRequest("PULL device1:systemTime")) == R"({"systemTime":"local"})");
    CLES_Response response = device2.makeCLESRequest("PULL device1:systemTime/UTC");
    BOOST_TEST(text_of(response) == R"({"systemTime":"UTC"})");
    device2.stop();
    device1.stop();
}

BOOST_FIXTURE_TEST_CASE(functions_of_all_verbs_take_nothing_parameters_or_both_and_return_anything, devices) {
    inbox got;
    BOOST_TEST(device1.registerPullFunction("none", [] { return 1.5; }));
    BOOST_TEST(device1.registerPushFunction("one", [&](texts args) { got.put(args.at(0)); }));
    BOOST_TEST(device1.registerDelegateFunction("one", [](texts args) { return args; }));
    BOOST_TEST(device1.registerDelegateFunction("both", [](texts args, CLES_Response data) {
        data["args"] = args.size();
        return data;
    }));
    BOOST_TEST(device1.registerBindFunction("bound", [&](texts args) {
        if (args.empty()) {
            throw cles::error(errc::denied, "which?");
        }
        got.put(args.at(0));
    }));
    BOOST_TEST(device1.registerUpdateFunction("notice", [&](texts, CLES_Response data) { got.put(text_of(data)); }));
    BOOST_TEST(device2.registerUpdateFunction("bound", [] {}));
    run();
    BOOST_TEST(ask("PULL device1:none") == R"({"value":1.5E0})");
    BOOST_TEST(ask("PUSH device1:one/a%20b {\"x\":1}") == "{}");
    BOOST_TEST(got.take() == "a b");
    BOOST_TEST(ask("DELEGATE device1:one/a/b [1]") == R"({"value":["a","b"]})");
    BOOST_TEST(ask(R"(DELEGATE device1:both/a/b {"x":1})") == R"({"x":1,"args":2})");
    BOOST_TEST(ask("DELEGATE device1:both [1]") == R"({"value":[1],"args":0})");
    BOOST_TEST(ask("BIND device1:bound/fast every=10") == "{}");
    BOOST_TEST(got.take() == "fast");
    BOOST_TEST(ask("BIND device1:bound") == message_of(errc::denied));
    BOOST_TEST(ask(R"(UPDATE device1:notice {"text":"hi"})") == "{}");
    BOOST_TEST(got.take() == R"({"text":"hi"})");
    BOOST_TEST(ask("PULL device1:nothing") == message_of(errc::no_task));
    BOOST_TEST(ask("nonsense") == message_of(errc::bad_request));
}

BOOST_FIXTURE_TEST_CASE(a_function_that_can_be_called_in_several_ways_gets_most, devices) {
    device1.registerPullFunction("one", [](texts args = {"none"}) { return args; });
    device1.registerPushFunction("any", [](auto... all) { return sizeof...(all); });
    run();
    BOOST_TEST(ask("PULL device1:one/a") == R"({"value":["a"]})");
    BOOST_TEST(ask("PUSH device1:any/a {\"x\":1}") == R"({"value":2})");
}

BOOST_FIXTURE_TEST_CASE(each_update_of_a_binding_calls_the_function_of_its_task, devices) {
    inbox got;
    device1.registerBindFunction("track", [] {});
    device2.registerUpdateFunction("track", [&](texts args, CLES_Response data) {
        got.put((args.empty() ? "" : args.front()) + text_of(data));
        if (data.contains("throw")) {
            throw std::runtime_error("nobody hears it");
        }
    });
    run();
    const auto publish = [&](const std::string& text) { device1.makeCLESRequest("UPDATE " + text); };
    publish(R"(device1:track/7 {"n":0})");
    BOOST_TEST(ask("BIND device1:track/7") == "{}");
    BOOST_TEST(got.take() == R"(7{"n":0})");
    BOOST_TEST(ask("BIND device1:track") == "{}");
    publish(R"(self:track {"n":1,"throw":true})");
    BOOST_TEST(got.take() == R"({"n":1,"throw":true})");
    publish(R"(device1:track/7 {"n":2})");
    BOOST_TEST(got.take() == R"(7{"n":2})");
    BOOST_TEST(ask("BIND device1:track") == "{}"); // again: the last value, and not two bindings
    BOOST_TEST(got.take() == R"({"n":1,"throw":true})");
    publish(R"(self:track {"n":3})");
    BOOST_TEST(got.take() == R"({"n":3})");
    BOOST_TEST(ask("BIND device1:track lease=0") == "{}");
    publish(R"(self:track {"n":4})");
    publish(R"(device1:track/7 {"n":5})");
    BOOST_TEST(got.take() == R"(7{"n":5})");
    BOOST_TEST(ask("BIND device1:other") == message_of(errc::bad_request));          // no function for its updates
    BOOST_TEST(ask(R"(UPDATE device1:track {"n":6})") == message_of(errc::no_task)); // only device1 publishes
}

BOOST_FIXTURE_TEST_CASE(in_a_function_a_request_would_deadlock, devices) {
    inbox got;
    const auto request = [&] {
        try {
            device1.makeCLESRequest("PULL device1:none");
            got.put("it was sent");
        } catch (const cles::error& e) {
            got.put(e.code().message());
        }
    };
    device1.registerPullFunction("none", [] {});
    device1.registerPullFunction("asks", request);
    device1.registerBindFunction("asks", request);
    device1.registerUpdateFunction("news", request);
    device1.registerPullFunction("adds", [&] { return device1.registerPullFunction("added", [] {}); });
    device2.registerUpdateFunction("asks", [] {});
    run();
    for (const std::string command : {"PULL device1:asks", "BIND device1:asks", "UPDATE device1:news {}"}) {
        BOOST_TEST(ask(command) == "{}");
        BOOST_TEST(got.take() == message_of(errc::would_deadlock), command);
    }
    device1.makeCLESRequest("BIND self:news");
    device1.makeCLESRequest(R"(UPDATE self:news {"n":1})"); // asked for, and received
    BOOST_TEST(got.take() == message_of(errc::would_deadlock));
    BOOST_TEST(got.take() == message_of(errc::would_deadlock));
    BOOST_TEST(ask("PULL device1:adds") == R"({"value":true})");
    BOOST_TEST(ask("PULL device1:added") == "{}");
}

BOOST_FIXTURE_TEST_CASE(any_thread_may_request_and_register_while_it_runs, devices) {
    device1.registerPullFunction("echo", [](texts args) { return args.at(0); });
    run();
    constexpr int each = 50;
    std::vector<std::future<int>> threads;
    for (int t = 0; t < 4; ++t) {
        threads.push_back(std::async(std::launch::async, [&, t] {
            int right = device1.registerPullFunction("task" + std::to_string(t), [] {}) ? 1 : 0;
            for (int i = 0; i < each; ++i) {
                const auto text = std::to_string(t) + "." + std::to_string(i);
                right += ask("PULL device1:echo/" + text) == "{\"value\":\"" + text + "\"}" ? 1 : 0;
            }
            return right;
        }));
    }
    for (auto& thread : threads) {
        BOOST_TEST(thread.get() == each + 1);
    }
    BOOST_TEST(ask("PULL device1:task3") == "{}");
}

BOOST_FIXTURE_TEST_CASE(stop_ends_requests_that_wait_and_the_service_for_good, devices) {
    // Shared, because the function may use them longer than this test.
    const auto begun = std::make_shared<std::promise<void>>();
    const auto over = std::make_shared<std::promise<void>>();
    device1.registerDelegateFunction("long", [begun, over] {
        begun->set_value();
        over->get_future().wait_for(cles::test::patience);
    });
    run();
    auto waits = std::async(std::launch::async, [&] { return ask("DELEGATE device1:long"); });
    begun->get_future().wait();
    device2.stop();
    BOOST_TEST(waits.get() == message_of(errc::stopped));
    device2.stop();
    BOOST_TEST(ask("PULL device1:long") == message_of(errc::stopped));
    BOOST_CHECK_THROW(device2.run(), cles::error);
    over->set_value();
}

BOOST_FIXTURE_TEST_CASE(several_threads_may_stop_it_at_the_same_time, devices) {
    run();
    std::vector<std::thread> threads;
    for (int i = 0; i < 3; ++i) {
        threads.emplace_back([&] { device1.stop(); });
    }
    threads.emplace_back([&] { device1.registerPullFunction("late", [] {}); }); // whether it is in time or not
    for (auto& each : threads) {
        each.join();
    }
    BOOST_CHECK_EXCEPTION(device1.run(), cles::error, [](const cles::error& e) { return e.code() == errc::stopped; });
}

BOOST_FIXTURE_TEST_CASE(a_function_may_stop_its_service, devices) {
    device1.registerPushFunction("stop", [&] { device1.stop(); });
    run();
    ask("PUSH device1:stop"); // the reply may be lost
    BOOST_CHECK_EXCEPTION(device1.makeCLESRequest("PULL self:cles"), cles::error,
                          [](const cles::error& e) { return e.code() == errc::stopped; });
}

BOOST_FIXTURE_TEST_CASE(before_it_runs_a_service_may_request, devices) {
    device1.registerPullFunction("systemTime", getSystemTime);
    device1.run();
    BOOST_TEST(ask("PULL device1:systemTime/UTC") == R"({"systemTime":"UTC"})");
    device2.run();
    BOOST_TEST(ask("PULL device1:systemTime/UTC") == R"({"systemTime":"UTC"})");
}

BOOST_FIXTURE_TEST_CASE(a_function_that_is_not_registered_gives_false, devices) {
    BOOST_TEST(device1.registerPullFunction("a", [] {}));
    BOOST_TEST(!device1.registerPullFunction("a", [] {}));
    BOOST_TEST(device1.registerPushFunction("a", [] {}));
    BOOST_TEST(!device1.registerPullFunction("a b", [] {}));
    run();
    BOOST_TEST(!device1.registerPullFunction("a", [] {}));
}

BOOST_FIXTURE_TEST_CASE(beyond_loopback_it_needs_keys, without_environment) {
    const auto refusal = [](const char* interface) {
        try {
            CLES_Service("device1", interface, 0);
            return std::string{"it listens"};
        } catch (const cles::error& e) {
            return e.code() == errc::insecure_listen ? e.message() : e.code().message();
        }
    };
    const std::string usual =
        "can be reached from other hosts, which are not authenticated; set 'insecure' to allow it";
    BOOST_TEST(refusal("0.0.0.0") == "'tcp://0.0.0.0:0' " + usual);
    BOOST_TEST(refusal("::") == "'tcp://[::]:0' " + usual);
    ::setenv("CLES_KEYS", "/nowhere", 1); // this program has no security
    BOOST_TEST(refusal("0.0.0.0") == "'tcp://0.0.0.0:0' " + usual + "; for the keys in CLES_KEYS, link cles::tls");
    BOOST_TEST(refusal("127.0.0.1") == "it listens");
    ::unsetenv("CLES_KEYS");
}

BOOST_AUTO_TEST_SUITE_END()
