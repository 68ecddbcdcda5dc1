// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/intrusive/list.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <list>
#include <utility>
#include <vector>

namespace cles::runtime {

/// The jobs that wait for a worker, served round-robin: requesters take turns, and the jobs of one requester keep their
/// order. So a requester with a thousand jobs makes another wait for one of them, not for all.
///
/// Items are linked in place: in steady state nothing is allocated.
class job_queue {
    // It borrows the items, and does not look at those that are left at its end.
    using link = boost::intrusive::list_base_hook<boost::intrusive::link_mode<boost::intrusive::normal_link>>;

  public:
    /// Something that can be queued. The queue borrows it until it is popped or removed.
    class item : public link {
      public:
        item() = default;
        item(const item&) = delete;
        item& operator=(const item&) = delete;

        /// Any number that identifies the requester. Not changed while this is queued.
        std::uint64_t requester = 0;
        /// Whether it may move to another node. Not changed while this is queued.
        bool movable = false;
        [[nodiscard]] bool queued() const noexcept { return queued_; }

      protected:
        ~item() = default;

      private:
        friend job_queue;
        bool queued_ = false;
        std::uint64_t order_ = 0; // of its first `push`
        std::uint64_t turn_ = 0;  // that its requester had when it was removed
    };

    explicit job_queue(std::size_t capacity) : capacity_(capacity) {}
    job_queue(const job_queue&) = delete;
    job_queue& operator=(const job_queue&) = delete;
    ~job_queue() = default;

    /// Queues a new job. False if the queue is full.
    [[nodiscard]] bool push(item& job);
    /// Queues a job that has started and continues: before the new jobs of its requester, and without a limit, because
    /// it has been admitted, and others may wait for it. From now on it is not movable.
    void push_resumed(item& job);
    /// Queues a job that has been removed but has not started, at its old place: among the jobs of its requester, whose
    /// turn comes no later than it did then. Without a limit.
    void put_back(item& job);
    /// Calls `see(job, ahead)` with the jobs in the order in which they will be popped, until it returns false. The
    /// queue must not be changed meanwhile.
    template <class F>
    void visit(F see);
    /// The next job; null if there is none.
    item* pop() noexcept;
    /// Removes a job if it is queued.
    void remove(item& job) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
    /// How many of the jobs are movable, and how many such jobs have been queued so far.
    [[nodiscard]] std::size_t movable() const noexcept { return movable_; }
    [[nodiscard]] std::uint64_t movable_queued() const noexcept { return movable_queued_; }

  private:
    /// The waiting jobs of one requester.
    struct requester_queue {
        std::uint64_t requester = 0;
        std::uint64_t turn = 0;
        boost::intrusive::list<item, boost::intrusive::constant_time_size<false>> jobs{};
    };
    using requesters = std::list<requester_queue>;

    requesters::iterator queue_for(item& job);
    void unlink(requesters::iterator from, item& job) noexcept;

    std::size_t capacity_;
    std::size_t size_ = 0;
    std::size_t movable_ = 0;
    std::uint64_t movable_queued_ = 0;
    std::uint64_t last_order_ = 0;
    std::uint64_t last_turn_ = 0;
    boost::unordered_flat_map<std::uint64_t, requesters::iterator> known_; // those in the next two
    requesters with_jobs_;                                                 // by turn: the first is served next
    requesters idle_;                                                      // without jobs, the latest at the end
};

template <class F>
void job_queue::visit(F see) {
    // Requesters take turns: first the first job of each, then the second of each.
    std::vector<std::pair<item*, requester_queue*>> turns;
    for (auto& each : with_jobs_) {
        turns.emplace_back(&each.jobs.front(), &each);
    }
    for (std::size_t ahead = 0; !turns.empty();) {
        for (auto& [job, of] : turns) {
            if (!see(*job, ahead++)) {
                return;
            }
            const auto next = std::next(of->jobs.iterator_to(*job));
            job = next != of->jobs.end() ? &*next : nullptr;
        }
        std::erase_if(turns, [](const auto& turn) { return turn.first == nullptr; });
    }
}

} // namespace cles::runtime
