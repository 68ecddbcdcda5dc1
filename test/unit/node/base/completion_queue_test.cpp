// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/base/completion_queue.hpp"
#include "node/base/peer_reply.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace cles::core;
using namespace std::chrono_literals;
using cles::errc;
using lines = std::vector<std::string>;

struct thrown_by_test {};

/// An operation that records how it ends.
class told_operation final : public cles::detail::pending {
  public:
    told_operation(lines& to, std::string name, bool users = true, std::function<void()> then = {})
        : to_(to), name_(std::move(name)), users_(users), then_(std::move(then)) {}

    verdict offer(std::string_view json) override {
        end(" has " + std::string{json});
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        end(" failed " + std::string{cles::wire_name(static_cast<errc>(code.value()))} + ": " + std::string{message});
    }
    void discard() noexcept override {
        to_.push_back(name_ + " discarded");
        delete this;
    }
    [[nodiscard]] bool calls_user() const noexcept override { return users_; }

  private:
    void end(const std::string& how) {
        to_.push_back(name_ + how);
        const auto then = std::move(then_);
        delete this;
        if (then) {
            then();
        }
    }

    lines& to_;
    std::string name_;
    bool users_;
    std::function<void()> then_;
};

struct fixture {
    cles::detail::pending_ptr operation(std::string name, bool users = true, std::function<void()> then = {}) {
        return cles::detail::pending_ptr{new told_operation{said, std::move(name), users, std::move(then)}};
    }
    completion_queue::runner keeper() {
        return [this](completion c) { waiting.push_back(std::move(c)); };
    }
    /// Calls what is due, as an executor does; returns how many have thrown.
    int run() {
        int thrown = 0;
        while (!waiting.empty()) {
            auto next = std::move(waiting.front());
            waiting.pop_front();
            try {
                next();
            } catch (const thrown_by_test&) {
                ++thrown;
            }
        }
        return thrown;
    }
    static void fling() { throw thrown_by_test{}; }

    lines said;
    std::deque<completion> waiting;
    completion_queue queue{keeper()};
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(completion_queue, fixture)

BOOST_AUTO_TEST_CASE(a_users_operation_completes_later_and_the_librarys_own_at_once) {
    queue.fail(operation("user's"), errc::busy, "full");
    queue.fail(operation("own", false), errc::busy, "full");
    queue.succeed(operation("user's"), "{}");
    queue.succeed(operation("own", false), "[1]");
    BOOST_TEST((said == lines{"own failed busy: full", "own has [1]"}));
    said.clear();
    run();
    BOOST_TEST((said == lines{"user's failed busy: full", "user's has {}"}));
}

// Nothing else would end it.
BOOST_AUTO_TEST_CASE(a_result_that_is_not_json_fails_its_operation) {
    auto [users, result] = cles::test::record();
    queue.succeed(std::move(users), "{\"a\"b\":1}");
    run();
    BOOST_TEST(result->ended);
    BOOST_TEST((result->code == errc::conversion));
    BOOST_TEST(result->text == "the answer is not valid JSON");
}

BOOST_AUTO_TEST_CASE(a_completion_put_during_a_call_is_called_after_it) {
    queue.fail(operation("one", true, [this] { queue.fail(operation("three"), errc::busy, ""); }), errc::busy, "");
    queue.fail(operation("two"), errc::busy, "");
    run();
    BOOST_TEST((said == lines{"one failed busy: ", "two failed busy: ", "three failed busy: "}));
}

BOOST_AUTO_TEST_CASE(an_exception_is_rethrown_when_the_library_is_done) {
    queue.now([] {});
    BOOST_TEST(!queue.has_thrown());
    BOOST_CHECK_NO_THROW(queue.rethrow());
    BOOST_CHECK_NO_THROW(queue.now([] { fling(); }));
    BOOST_CHECK_NO_THROW(queue.now([] { fling(); }));
    queue.call([this] { said.emplace_back("called"); });
    BOOST_TEST(queue.has_thrown());
    BOOST_CHECK_THROW(queue.rethrow(), thrown_by_test);
    BOOST_TEST(!queue.has_thrown());
    BOOST_TEST(run() == 1); // the other one
    BOOST_TEST((said == lines{"called"}));
}

BOOST_AUTO_TEST_CASE(a_completion_that_is_not_called_is_discarded) {
    queue.fail(operation("one"), errc::busy, "");
    waiting.clear();
    BOOST_TEST((said == lines{"one discarded"}));
}

BOOST_AUTO_TEST_CASE(without_a_runner_completions_are_called_at_once) {
    cles::core::completion_queue inline_queue;
    inline_queue.fail(operation("one"), errc::busy, "");
    BOOST_TEST((said == lines{"one failed busy: "}));
    BOOST_CHECK_THROW(inline_queue.call([] { fling(); }), thrown_by_test);
}

// -- in a node -----------------------------------------------------------------------------------------------------

struct node_fixture : fixture {
    node_fixture() {
        node.host = std::make_shared<cles::core::node_state>(
            node_options{.name = "car1", .epoch = 1, .complete = keeper()}, node.clock, [] {});
        made = std::make_unique<cles::test::test_link>(node);
    }
    void ask(std::uint64_t id, std::function<void()> then = {}) {
        made->session().asking().send({.verb = cles::verb::pull, .noun = "car2:speed", .id = id},
                                      node.clock.now() + 100ms, node.clock.now(),
                                      operation(std::to_string(id), true, std::move(then)));
    }

    cles::test::test_node node;
    std::unique_ptr<cles::test::test_link> made; // made when the node has its queue
};

BOOST_FIXTURE_TEST_CASE(a_lost_link_tells_all_whatever_one_of_them_does, node_fixture) {
    ask(1, fling);
    ask(2, [this] { made->session().asking().cancel(3); });
    ask(3);
    ask(4, fling);
    made->reset();
    BOOST_TEST(said.empty());
    BOOST_TEST(run() == 2);
    BOOST_TEST(said.size() == 4U);
}

BOOST_FIXTURE_TEST_CASE(equal_deadlines_tell_all_and_later_ones_still_come, node_fixture) {
    ask(1, fling);
    ask(2, fling);
    ask(3);
    node.pass(100ms);
    BOOST_TEST(said.empty());
    BOOST_TEST(run() == 2);
    BOOST_TEST(said.size() == 3U);
    ask(4);
    node.pass(100ms);
    BOOST_TEST(run() == 0);
    BOOST_TEST(said.size() == 4U);
}

BOOST_FIXTURE_TEST_CASE(an_answer_is_told_at_once_and_what_is_thrown_leaves_the_line_behind_it_alone, node_fixture) {
    ask(1, fling);
    ask(2);
    made->ask("id=1 {}");
    made->ask(R"(id=2 {"error":"busy","message":"full"})");
    BOOST_TEST((said == lines{"1 has {}", "2 failed busy: full"}));
    BOOST_CHECK_THROW(node.host->completions.rethrow(), thrown_by_test);
    BOOST_TEST(run() == 0);
}

BOOST_AUTO_TEST_CASE(the_answer_to_a_probe_is_the_librarys_own) {
    const cles::detail::pending_ptr probe{new cles::core::peer_reply{nullptr}};
    BOOST_TEST(!probe->calls_user());
}

BOOST_AUTO_TEST_SUITE_END()
