// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "node/session/call.hpp"
#include "simulation/workload/part.hpp"
#include "simulation/world/node_run.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace cles::simulation {

class world;

/// Whether a reply's or an update's body is that of this request.
[[nodiscard]] bool speaks_of(std::string_view json, std::uint32_t op);

/// Requests and what serves them: every node asks every other for all verbs but BIND, has some withdrawn, and answers
/// at once, later, or never. Each request bears a number of its own, which its answer tells.
class asking final : public part {
  public:
    explicit asking(world& in) noexcept : world_(in) {}

    void perform(const action& what) override;
    void on_start(node_run& n) override;
    void probe() override;
    void judge_probe() override;
    void judge_rest() override;

    /// Takes note that a request has run.
    void ran(std::uint32_t op, const node_run& at);

  private:
    class answer;
    struct asked {
        std::uint32_t op = 0;
        unsigned from = 0;
        unsigned run = 0; // of the node that asked
        unsigned to = 0;
        unsigned what = 0;
        carrier by = carrier::stream;
        std::uint64_t id = 0;
        time_point deadline{};  // by the network's clock
        bool may_fail = false;  // the handler was told to
        bool withdrawn = false; // by its requester
        bool vital = false;     // has to succeed
        bool ended = false;
        bool succeeded = false;
        double reported = 0;
    };
    struct order {
        std::uint32_t op;
        unsigned from;
        unsigned to;
        carrier by;
        unsigned what;
        std::uint32_t deadline;
        std::uint32_t size;
        std::uint32_t work;
        std::uint32_t steps;
        std::uint32_t end;
        bool vital;
    };

    void ask(const order& o);
    void cancel(std::uint32_t op);
    void on_progress(std::uint32_t op, double fraction, std::string_view json);
    void on_end(asked& a);
    void on_success(std::uint32_t op, std::string_view json);
    void on_failure(std::uint32_t op, errc code, std::string_view message);
    [[nodiscard]] bool has_run(const asked& a) const;
    [[nodiscard]] bool is_answered_by_leaver(const asked& a);
    void complain(rule which, const asked& a, const std::string& what);

    void offer_at_once(node_run& n);
    void offer_later(node_run& n);
    void begin(node_run& n, std::uint32_t op, const std::shared_ptr<core::call>& call, std::uint32_t work,
               std::uint32_t steps, std::uint32_t end);

    world& world_;
    std::map<std::uint32_t, asked> asked_;
    std::unordered_map<std::uint64_t, unsigned> effects_;     // by request, host and run
    std::map<core::call*, std::shared_ptr<core::call>> held_; // never answered
    std::vector<std::shared_ptr<core::call>> kept_;           // by a planted fault
    std::uint32_t next_probe_ = 10'000'000;
};

} // namespace cles::simulation
