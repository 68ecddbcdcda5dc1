// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// What those hold who have not proved yet who they are, such as links without a line: of each source, how much and for
/// how long. When there is no more, the source that holds most gives way, so the others cannot be shut out.
template <class Holder>
class stranger_places {
    struct entry {
        Holder* by;
        std::uint64_t number; // the smallest is the oldest
    };
    using entries = std::list<entry>;
    struct table {
        std::map<std::string, entries, std::less<>> sources; // none is empty
        std::size_t size = 0;
        std::size_t amount = 0;
    };

  public:
    /// Held until it is released or destroyed. May outlive the places.
    class place {
      public:
        place() = default;
        place(place&& from) noexcept
            : of_(std::exchange(from.of_, nullptr)), source_(from.source_), entry_(from.entry_),
              amount_(std::exchange(from.amount_, 0)) {}
        place& operator=(place&& from) noexcept {
            if (this != &from) {
                release();
                of_ = std::exchange(from.of_, nullptr);
                source_ = from.source_;
                entry_ = from.entry_;
                amount_ = std::exchange(from.amount_, 0);
            }
            return *this;
        }
        ~place() { release(); }

        [[nodiscard]] bool is_held() const noexcept { return of_ != nullptr; }
        /// What is held there, such as bytes: at first nothing. \pre it is held
        void set_amount(std::size_t value) noexcept {
            of_->amount += value - amount_;
            amount_ = value;
        }
        [[nodiscard]] std::size_t amount() const noexcept { return amount_; }
        void release() noexcept {
            if (const auto of = std::exchange(of_, nullptr)) {
                --of->size;
                of->amount -= std::exchange(amount_, 0);
                source_->second.erase(entry_);
                if (source_->second.empty()) {
                    of->sources.erase(source_);
                }
            }
        }

      private:
        friend stranger_places;

        std::shared_ptr<table> of_;
        typename decltype(table::sources)::iterator source_{};
        typename entries::iterator entry_{};
        std::size_t amount_ = 0;
    };

    /// \param by may not move while it holds the place
    [[nodiscard]] place take(std::string_view source, Holder& by) {
        auto at = table_->sources.find(source);
        if (at == table_->sources.end()) {
            at = table_->sources.try_emplace(std::string{source}).first;
        }
        at->second.push_back({.by = &by, .number = ++last_});
        place made;
        made.source_ = at;
        made.entry_ = std::prev(at->second.end());
        made.of_ = table_;
        ++table_->size;
        return made;
    }

    /// Of the source that holds most, the one that holds its place for longest; null if nobody holds one.
    [[nodiscard]] Holder* first_to_yield() const noexcept {
        const entries* most = nullptr;
        for (const auto& [source, each] : table_->sources) {
            if (most == nullptr || each.size() > most->size() ||
                (each.size() == most->size() && each.front().number < most->front().number)) {
                most = &each;
            }
        }
        return most == nullptr ? nullptr : most->front().by;
    }
    /// The one that holds its place for longest, whatever its source; null if nobody holds one.
    [[nodiscard]] Holder* oldest() const noexcept {
        const entry* first = nullptr;
        for (const auto& [source, each] : table_->sources) {
            if (first == nullptr || each.front().number < first->number) {
                first = &each.front();
            }
        }
        return first == nullptr ? nullptr : first->by;
    }
    [[nodiscard]] std::size_t size() const noexcept { return table_->size; }
    /// In all places.
    [[nodiscard]] std::size_t amount() const noexcept { return table_->amount; }
    [[nodiscard]] std::size_t held_by(std::string_view source) const noexcept {
        const auto found = table_->sources.find(source);
        return found == table_->sources.end() ? 0 : found->second.size();
    }

  private:
    std::shared_ptr<table> table_ = std::make_shared<table>();
    std::uint64_t last_ = 0;
};

} // namespace cles::core
