// SPDX-License-Identifier: BSL-1.0
// Takes the code through every transition of the model of work sharing (test/model/sharing.pml), so that the two agree.

#include <cles/sharing.hpp>

#include "jobs/job_pool.hpp"
#include "node/sharing/slot_grants.hpp"
#include "pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <utility>

BOOST_AUTO_TEST_SUITE(sharing_transitions)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::core::slot_grants;

// -- a job at the node with the queue --------------------------------------------------------------------------------

/// The other node, as the pool sees it: takes jobs, and ends them as the test says.
class other_node final : public cles::job_sharing, private cles::job_taker {
  public:
    explicit other_node(cles::shareable_queue& jobs) : jobs_(jobs) {}

    void grant() {
        left_ = 1;
        jobs_.offer(*this);
    }
    void end(bool refused) { std::exchange(ended_, nullptr)(refused); }
    [[nodiscard]] bool has_job() const noexcept { return ended_ != nullptr; }
    [[nodiscard]] bool was_withdrawn() const noexcept { return withdrawn_; }

    [[nodiscard]] bool may_move(const cles::core::call&) const noexcept override { return true; }
    void on_change() override {}
    void withdraw(std::uint64_t) override {
        ended_ = nullptr;
        withdrawn_ = true;
    }

  private:
    [[nodiscard]] bool full() const noexcept override { return left_ == 0; }
    [[nodiscard]] bool choose(const cles::core::call&, std::size_t, std::chrono::microseconds) override {
        return left_-- > 0;
    }
    std::uint64_t take(std::shared_ptr<cles::core::call> job, std::string_view,
                       std::function<void(bool refused)> ended) override {
        job_ = std::move(job);
        ended_ = std::move(ended);
        return 7;
    }

    cles::shareable_queue& jobs_;
    std::shared_ptr<cles::core::call> job_;
    std::function<void(bool refused)> ended_;
    int left_ = 0;
    bool withdrawn_ = false;
};

/// A pool of one worker, and one job: it waits behind another one, which holds the worker.
struct holder : pooled_node {
    enum class state { waiting, running, moved, done };

    holder() : pooled_node({.workers = 1, .close_timeout = 5s}), client(peer()) {
        auto sharing = std::make_unique<other_node>(pool->dispatcher()->queue());
        other = sharing.get();
        pool->dispatcher()->share(std::move(sharing));
        add_held("first");
        tasks->on_delegate("job", [gate = second, notes = begun](const cles::request&, const cles::responder& answer) {
            answer.on_stop([notes] { notes->add("stopped"); });
            notes->add("begun");
            gate->pass();
            answer.done();
        });
        client.send("DELEGATE self:first id=1\n");
        wait_for([&] { return pool->load().running == 1 && pool->load().queued == 0; });
        client.send("DELEGATE self:job id=2\n");
        wait_for([&] { return pool->load().queued == 1; });
    }
    ~holder() {
        hold.open();
        second->open();
    }

    [[nodiscard]] state now() const {
        if (answered) {
            return state::done;
        }
        return other->has_job() ? state::moved : begun->size() == 0 ? state::waiting : state::running;
    }
    void run() {
        hold.open();
        wait_for([&] { return now() == state::running; });
    }
    void cancel() { client.send("PUSH self:cles/cancel/2 id=3\n"); }
    /// Waits for the reply to the job, and returns it.
    std::string reply() {
        for (;;) {
            const auto line = client.line();
            if (line.starts_with("id=2 ")) {
                answered = true;
                return line;
            }
        }
    }
    std::string stop_at_once() {
        pool->drain(0ms, [](const cles::runtime::drain_report&) {});
        return reply();
    }

    std::shared_ptr<gate> second = std::make_shared<gate>(); // of jobs that outlive this
    std::shared_ptr<notes> begun = std::make_shared<notes>();
    scripted_peer client;
    other_node* other = nullptr;
    bool answered = false;
};

// -- a grant at the node with free workers ----------------------------------------------------------------------------

struct helper {
    [[nodiscard]] bool is_open() const { return grants.check("holder", 7, now) == slot_grants::verdict::valid; }
    void open(unsigned slots) {
        grants.open("holder", 7, slots, now);
        grants.reserve("holder", slots, now + slot_grants::valid_for, now);
    }

    slot_grants grants;
    cles::time_point now{};
};

#define SHOW(condition) BOOST_TEST(condition, what << ": " #condition)

const std::map<std::string, std::function<void(const std::string& what)>> transitions{
    {"holder.waiting worker_free holder.running",
     [](const std::string& what) {
         holder h;
         SHOW((h.now() == holder::state::waiting));
         h.run();
         SHOW((h.now() == holder::state::running));
     }},
    {"holder.waiting granted holder.moved",
     [](const std::string& what) {
         holder h;
         h.other->grant();
         SHOW((h.now() == holder::state::moved));
         SHOW(h.pool->load().queued == 0U);
         h.hold.open(); // a worker that becomes free does not run it
         h.wait_for([&] { return h.pool->load().running == 0; });
         SHOW(h.begun->size() == 0U);
     }},
    {"holder.waiting withdrawn holder.done",
     [](const std::string& what) {
         holder h;
         h.cancel();
         SHOW(h.reply().find("cancelled") != std::string::npos);
         h.wait_for([&] { return h.pool->load().queued == 0; });
         h.other->grant();
         SHOW(!h.other->has_job());
     }},
    {"holder.waiting stopped holder.done",
     [](const std::string& what) {
         holder h;
         SHOW(h.stop_at_once().find("busy") != std::string::npos);
         SHOW(h.begun->size() == 0U);
     }},
    {"holder.running answered holder.done",
     [](const std::string& what) {
         holder h;
         h.run();
         h.second->open();
         SHOW(h.reply() == "id=2 {}");
     }},
    {"holder.running withdrawn holder.done",
     [](const std::string& what) {
         holder h;
         h.run();
         h.cancel();
         SHOW(h.reply().find("cancelled") != std::string::npos);
         h.wait_for([&] { return h.begun->has("stopped"); });
         h.other->grant(); // it has begun here
         SHOW(!h.other->has_job());
     }},
    {"holder.running stopped holder.done",
     [](const std::string& what) {
         holder h;
         h.run();
         SHOW(h.stop_at_once().find("unavailable") != std::string::npos);
     }},
    {"holder.moved answered holder.done",
     [](const std::string& what) {
         holder h;
         h.other->grant();
         h.other->end(false);
         SHOW(h.pool->figures().moved == 1U);
         h.hold.open();
         h.wait_for([&] { return h.pool->load().running == 0; });
         SHOW(h.begun->size() == 0U);
     }},
    {"holder.moved lost holder.done",
     [](const std::string& what) {
         holder h;
         h.other->grant();
         h.other->end(false); // for the pool, as any other outcome
         h.hold.open();
         h.wait_for([&] { return h.pool->load().running == 0; });
         SHOW(h.begun->size() == 0U);
     }},
    {"holder.moved refused holder.waiting",
     [](const std::string& what) {
         holder h;
         h.other->grant();
         h.other->end(true);
         SHOW((h.now() == holder::state::waiting));
         SHOW(h.pool->load().queued == 1U);
         h.run();
         h.second->open();
         SHOW(h.reply() == "id=2 {}");
         h.wait_for([&] { return h.pool->figures().answered == 2; });
         SHOW(h.pool->figures().admitted == 2U);
         SHOW(h.pool->figures().moved == 0U);
     }},
    {"holder.moved withdrawn holder.done",
     [](const std::string& what) {
         holder h;
         h.other->grant();
         h.cancel();
         SHOW(h.reply().find("cancelled") != std::string::npos);
         h.wait_for([&] { return h.other->was_withdrawn(); });
     }},
    {"holder.moved stopped holder.done",
     [](const std::string& what) {
         holder h;
         h.other->grant();
         SHOW(h.stop_at_once().find("unavailable") != std::string::npos);
         SHOW(h.other->was_withdrawn());
     }},
    {"helper.none offered helper.open",
     [](const std::string& what) {
         helper h;
         SHOW(!h.is_open());
         h.open(1);
         SHOW(h.is_open());
     }},
    {"helper.open used helper.open",
     [](const std::string& what) {
         helper h;
         h.open(2);
         h.grants.use("holder");
         SHOW(h.is_open());
     }},
    {"helper.open used helper.closed",
     [](const std::string& what) {
         helper h;
         h.open(1);
         h.grants.use("holder");
         SHOW(!h.is_open());
     }},
    {"helper.open taken helper.open",
     [](const std::string& what) {
         helper h;
         h.open(2);
         h.grants.unreserve("holder", 7, 2);
         SHOW(h.is_open());
         SHOW(h.grants.reserved(h.now) == 0U);
     }},
    {"helper.open expired helper.closed",
     [](const std::string& what) {
         helper h;
         h.open(2);
         h.now += slot_grants::valid_for;
         SHOW(!h.is_open());
     }},
    {"helper.open own_job helper.open",
     [](const std::string& what) {
         helper h; // a job of its own takes the worker: the grant is not used (unit.work_sharing/its_own_jobs_go_first)
         h.open(1);
         h.grants.arrived("holder", 7, h.now);
         SHOW(h.is_open());
         SHOW(h.grants.reserved(h.now) == 0U);
     }},
    {"helper.closed late helper.closed",
     [](const std::string& what) {
         helper h;
         h.open(1);
         h.grants.use("holder");
         SHOW((h.grants.check("holder", 7, h.now) == slot_grants::verdict::over));
         SHOW((h.grants.check("holder", 8, h.now) == slot_grants::verdict::unknown));
         SHOW((h.grants.check("another", 7, h.now) == slot_grants::verdict::unknown));
         SHOW(!h.is_open());
     }},
};

std::set<std::string> transitions_of_the_model() {
    std::ifstream file{CLES_MODEL};
    const std::string text{std::istreambuf_iterator<char>{file}, {}};
    static const std::regex annotation{R"(/\* T (\w+\.\w+) --(\w+)--> (\w+\.\w+) \*/)"};
    std::set<std::string> found;
    for (auto at = std::sregex_iterator{text.begin(), text.end(), annotation}; at != std::sregex_iterator{}; ++at) {
        found.insert((*at)[1].str() + " " + (*at)[2].str() + " " + (*at)[3].str());
    }
    return found;
}

BOOST_AUTO_TEST_CASE(those_of_the_model_are_those_of_this_test) {
    std::set<std::string> ours;
    for (const auto& [what, make] : transitions) {
        ours.insert(what);
    }
    const auto model = transitions_of_the_model();
    BOOST_TEST_REQUIRE(model.size() > 10U);
    BOOST_TEST(model == ours, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(the_code_makes_each) {
    for (const auto& [what, make] : transitions) {
        make(what);
    }
}

BOOST_AUTO_TEST_SUITE_END()
