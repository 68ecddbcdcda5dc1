// SPDX-License-Identifier: BSL-1.0
// Signed requests of this node, which is car2, for a node of another pool.
#include <cles/link.hpp>

#include "node/local_node.hpp"
#include "node/secured/request_signer.hpp"
#include "node/secured/secured_protocol.hpp"
#include "support/manual_clock.hpp"
#include "support/recorded_reply.hpp"
#include "support/scripted_security.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace request_signer {
namespace {

using cles::errc;
using cles::verb;
using cles::test::scripted_security;
using namespace std::chrono_literals;

/// A link to a node that forwards, which the test plays.
class recorded_link final : public cles::link {
  public:
    void start(std::shared_ptr<cles::link_events> owner) override { owner_ = std::move(owner); }
    std::string& output() override { return output_; }
    void flush() override { lines += std::exchange(output_, {}); }
    [[nodiscard]] std::size_t unsent() const noexcept override { return 0; }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return lines.size(); }
    [[nodiscard]] std::uint64_t received() const noexcept override { return 0; }
    void pause(bool) override {}
    void finish() override {}
    void close() override { owner_.reset(); }
    [[nodiscard]] const cles::identity& peer() const noexcept override { return peer_; }

    void say(const std::string& line) {
        const auto owner = owner_;
        owner->on_line(line);
        owner->on_batch();
    }

    std::string lines;

  private:
    std::string output_;
    std::shared_ptr<cles::link_events> owner_;
    cles::identity peer_{.transport = "tls", .address = "tls://10.0.0.9:1", .name = "sat1", .uid = {}, .local = false};
};

/// Whatever is dialled is the link.
class one_link_environment final : public cles::core::environment {
  public:
    [[nodiscard]] cles::time_point now() const override { return clock.now(); }
    std::uint32_t random() override { return ++drawn_; }
    void post(std::shared_ptr<cles::core::task> next) override { tasks_.push_back(std::move(next)); }
    void start_timer(std::function<void()>) override {}
    void set_timer(cles::time_point) override {}
    void stop_timer() override {}
    [[nodiscard]] bool has_transport(std::string_view) const override { return true; }
    [[nodiscard]] bool is_trusted(const cles::url&) const override { return true; }
    [[nodiscard]] bool is_exposed(const cles::url&) const override { return false; }
    std::unique_ptr<cles::acceptor> listen(const cles::url&, const cles::limits&) override { throw none(); }
    std::function<void()> dial(const cles::url&, std::string_view, const cles::limits&,
                               cles::dial_callback done) override {
        cles::core::post(*this, [this, done = std::move(done)] { done({}, link); });
        return [] {};
    }
    [[nodiscard]] std::string local_scope() const override { return "test"; }
    [[nodiscard]] bool is_open(const std::string&) const override { return false; }
    std::vector<cles::core::network_interface> interfaces() override { return {}; }
    cles::core::network_interface find_interface(const std::string&) override { throw none(); }
    std::shared_ptr<cles::core::group_port> join(const cles::core::network_interface&,
                                                 const cles::multicast_options&) override {
        throw none();
    }

    void run() {
        while (!tasks_.empty()) {
            const auto next = std::move(tasks_.front());
            tasks_.pop_front();
            next->run();
        }
    }

    std::shared_ptr<recorded_link> link = std::make_shared<recorded_link>();
    cles::test::manual_clock clock;

  private:
    static std::logic_error none() { return std::logic_error{"there is no network"}; }

    std::uint32_t drawn_ = 0;
    std::deque<std::shared_ptr<cles::core::task>> tasks_;
};

struct fixture {
    fixture() {
        security->self = "car2";
        local->node().secured->start(*local);
    }
    ~fixture() {
        local->stop();
        environment->run();
    }
    fixture(const fixture&) = delete;
    fixture& operator=(const fixture&) = delete;

    /// Sends the request to the node that forwards. Returns how it ends.
    std::shared_ptr<cles::test::outcome> ask(const std::string& noun) {
        auto [operation, result] = cles::test::record();
        local->send(verb::delegate, noun, "{\"a\":1}", cles::call_options{}.at("tls://10.0.0.9:1"),
                    std::move(operation));
        environment->run();
        return result;
    }
    void pass(std::chrono::nanoseconds time) {
        environment->clock.advance(time);
        local->node().deadlines.expire(environment->clock.now());
        environment->run();
    }
    std::string take() { return std::exchange(environment->link->lines, {}); }
    static std::string id_in(const std::string& line) {
        const auto at = line.find(" id=");
        BOOST_REQUIRE_MESSAGE(at != std::string::npos, line);
        return line.substr(at + 4, line.find(' ', at + 4) - at - 4);
    }
    /// Replies to the request in the line that was sent last. Returns what is sent then.
    std::string reply(const std::string& to, const std::string& json) {
        environment->link->say("id=" + id_in(to) + " " + json);
        environment->run();
        return take();
    }
    static std::string denied_by(const std::string& node) {
        return R"({"error":"denied","message":"sign it","node":")" + node + R"(","challenge":"challenge1"})";
    }
    /// The value of `sig=`.
    static std::string signature(const std::string& node, std::uint32_t waits_ms = 30'000) {
        return scripted_security::request_signature("car2", node, "challenge1", verb::delegate, "strike/now",
                                                    "{\"a\":1}", waits_ms) +
               "." + std::to_string(waits_ms);
    }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    std::shared_ptr<one_link_environment> environment = std::make_shared<one_link_environment>();
    std::shared_ptr<cles::core::local_node> local = std::make_shared<cles::core::local_node>(
        environment,
        cles::core::local_node_options{
            .node = {.name = "car2", .security = security, .secured = &cles::core::make_secured_protocol}});
};

} // namespace
} // namespace request_signer

BOOST_FIXTURE_TEST_SUITE(request_signer, fixture)

BOOST_AUTO_TEST_CASE(it_signs_for_the_node_of_another_pool) {
    const auto result = ask("north.car1:strike/now");
    const auto first = take();
    BOOST_TEST(first.starts_with("DELEGATE north.car1:strike/now id="), first);
    BOOST_TEST(first.find("sig=") == std::string::npos, first);
    const auto second = reply(first, denied_by("car1"));
    // To the pool that was named: a node of that name need not be known here.
    BOOST_TEST(second.starts_with("DELEGATE north.car1:strike/now id="), second);
    BOOST_TEST(second.find(" sig=" + signature("car1") + " ") != std::string::npos, second);
    BOOST_TEST(!result->ended);
    reply(second, "{\"done\":true}");
    BOOST_TEST(result->text == "{\"done\":true}");
    BOOST_TEST(!result->code);
}

BOOST_AUTO_TEST_CASE(it_signs_how_long_it_still_waits) {
    ask("north.car1:strike/now");
    const auto first = take();
    environment->clock.advance(4s + 300us);
    const auto second = reply(first, denied_by("car1"));
    BOOST_TEST(second.find(" sig=" + signature("car1", 25'999) + " ") != std::string::npos, second);
}

BOOST_AUTO_TEST_CASE(not_for_another_node) {
    for (const std::string node : {"car3", "sat1", "north.car1", "north", "any", ""}) {
        const auto result = ask("north.car1:strike/now");
        BOOST_TEST(reply(take(), denied_by(node)).empty(), node);
        BOOST_TEST(result->ended, node);
        BOOST_TEST((result->code == errc::denied), node);
    }
}

BOOST_AUTO_TEST_CASE(a_member_whose_name_has_a_dot_is_itself) {
    security->members.insert("north.car1");
    const auto refused = ask("north.car1:strike/now");
    BOOST_TEST(reply(take(), denied_by("car1")).empty());
    BOOST_TEST((refused->code == errc::denied));
    const auto result = ask("north.car1:strike/now");
    const auto second = reply(take(), denied_by("north.car1"));
    BOOST_TEST(second.starts_with("DELEGATE north.car1:strike/now id="), second);
    BOOST_TEST(second.find(" sig=" + signature("north.car1") + " ") != std::string::npos, second);
    BOOST_TEST(!result->ended);
}

BOOST_AUTO_TEST_CASE(for_any_it_goes_to_the_node_that_has_answered) {
    const auto result = ask("any:strike/now");
    const auto second = reply(take(), denied_by("car1"));
    BOOST_TEST(second.starts_with("DELEGATE car1:strike/now id="), second);
    BOOST_TEST(!result->ended);
    security->denied = {"car2 DELEGATE car3:strike/now"};
    const auto other = ask("any:strike/now");
    BOOST_TEST(reply(take(), denied_by("car3")).empty());
    BOOST_TEST((other->code == errc::denied));
}

BOOST_AUTO_TEST_CASE(a_second_challenge_is_not_answered) {
    const auto result = ask("north.car1:strike/now");
    const auto second = reply(take(), denied_by("car1"));
    BOOST_TEST(reply(second, denied_by("car1")).empty());
    BOOST_TEST((result->code == errc::denied));
}

// -- replies to `all` of a node that may state anything ---------------------------------------------------------------

BOOST_AUTO_TEST_CASE(names_in_a_reply_to_all_are_written_as_json) {
    const auto result = ask("all:strike/now");
    const auto second = reply(take(), R"({"results":{"x\"}\u001b,{":1},"errors":{"car1":)" + denied_by("car1") + "}}");
    BOOST_TEST(second.starts_with("DELEGATE car1:strike/now id="), second);
    reply(second, "{\"done\":true}");
    BOOST_TEST(result->ended);
    BOOST_TEST(result->text == R"({"results":{"car1":{"done":true},"x\"}\u001b,{":1},"errors":{}})");
}

BOOST_AUTO_TEST_CASE(nothing_is_signed_for_what_is_no_name) {
    for (const std::string name : {"x\\n.car1", "x y.car1", "\\\".car1"}) {
        const auto result = ask("all:strike/now");
        const auto json = R"({"results":{},"errors":{")" + name + "\":" + denied_by("car1") + "}}";
        BOOST_TEST(reply(take(), json).empty(), name);
        BOOST_TEST(result->text == json, name);
    }
}

BOOST_AUTO_TEST_CASE(a_member_gets_one_signature_for_all) {
    const auto result = ask("all:strike/now");
    const auto second = reply(take(), R"({"results":{},"errors":{"north.car1":)" + denied_by("car1") +
                                          R"(,"south.car1":)" + denied_by("car1") + "}}");
    BOOST_TEST(second.find(" sig=") != std::string::npos, second);
    BOOST_TEST(second.find(" sig=") == second.rfind(" sig="), second);
    reply(second, "{}");
    BOOST_TEST(result->text == R"({"results":{"north.car1":{}},"errors":{"south.car1":)" + denied_by("car1") + "}}");
}

BOOST_AUTO_TEST_CASE(an_answer_that_is_too_deep_in_all_is_an_error_of_its_node) {
    const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
    for (const std::size_t depth : {33U, 34U, 35U}) {
        const auto result = ask("all:strike/now");
        reply(reply(take(), R"({"results":{},"errors":{"car1":)" + denied_by("car1") + "}}"), nested(depth));
        BOOST_TEST(result->ended, depth);
        BOOST_TEST((result->text.find("nested too deeply") != std::string::npos) == (depth > 33), result->text);
    }
}

// Whatever is answered, and when: it is not answered in time, or the operation ends earlier.
BOOST_AUTO_TEST_CASE(no_request_outlives_its_deadline) {
    const auto denied = denied_by("car1");
    for (const std::string target : {"car1", "north.car1", "any", "all"}) {
        for (const std::string& first :
             {std::string{"{"}, std::string{"[1"}, std::string{"{\"a\":\"\x01\"}"}, std::string{"{}garbage"},
              std::string{"{\"error\":\"busy\""}, std::string{"progress=0.5 {}"}, std::string{"progress=2 {}"},
              std::string(40, '[') + std::string(40, ']'), denied, denied + "x",
              R"({"results":{"\"":1},"errors":{"car1":)" + denied + "}}",
              R"({"results":{},"errors":{"car1":)" + denied + R"(,"a\"b":{}}})"}) {
            for (const std::string second : {"{", "{\"a\":", "progress=0.5 {}", "{\"error\":\"denied\"", ""}) {
                const auto result = ask(target + ":strike/now");
                pass(10s);
                if (const auto repeated = reply(take(), first); !repeated.empty() && !second.empty()) {
                    reply(repeated, second);
                }
                pass(20s);
                BOOST_TEST(result->ended, target << ' ' << first << ' ' << second);
                take();
            }
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
