// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace cles::runtime {

struct turn;

/// Jobs that wait for a worker, in fair turns: the requesters with waiting jobs take turns, and the jobs of one follow
/// each other. So one with a thousand jobs makes another wait for one of them, not for all.
///
/// What is queued is linked in place: in steady state nothing is allocated.
class job_queue {
  public:
    /// What can be queued. The queue borrows it until it is popped or removed.
    class item {
      public:
        item() = default;
        item(const item&) = delete;
        item& operator=(const item&) = delete;

        /// Who asked: any number that tells one requester from another.
        std::uint64_t requester = 0;
        [[nodiscard]] bool queued() const noexcept { return in_ != nullptr; }

      protected:
        ~item() = default;

      private:
        friend job_queue;
        turn* in_ = nullptr;
        item* before_ = nullptr;
        item* after_ = nullptr;
    };

    explicit job_queue(std::size_t capacity);
    job_queue(const job_queue&) = delete;
    job_queue& operator=(const job_queue&) = delete;
    ~job_queue();

    /// Queues a new job. False where there are as many as there may be.
    [[nodiscard]] bool push(item& job);
    /// Queues a job that has begun and goes on: before the new ones of its requester, and however many there are, for
    /// it has been admitted already and others may wait for it.
    void push_begun(item& job);
    /// The next one; null where there is none.
    item* pop() noexcept;
    /// Takes out a job that is queued.
    void remove(item& job) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool empty() const noexcept { return size_ == 0; }

  private:
    turn* turn_of(std::uint64_t requester);
    void take_out(item& job) noexcept;
    void sweep();

    std::size_t capacity_;
    std::size_t size_ = 0;
    boost::unordered_flat_map<std::uint64_t, std::unique_ptr<turn>> turns_;
    std::vector<std::unique_ptr<turn>> spare_;
    turn* next_ = nullptr; // of a ring of those that have jobs
    std::size_t idle_ = 0; // those that have none
};

} // namespace cles::runtime
