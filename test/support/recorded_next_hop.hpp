// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/routing/next_hop.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// The channels to other nodes, whose part the test plays.
class recorded_next_hop final : public core::next_hop {
  public:
    struct sent {
        std::uint64_t ticket = 0;
        std::string node;
        std::string text; ///< "PULL car2:speed hops=7 via=car1 {}", as far as present
        std::string line; ///< as it is written on a link, with its LF
        time_point deadline{};
        protocol::carried_adverbs carried{};
        bool cancelled = false;
        detail::pending_ptr reply{};
        core::outbound::progress_function progress{};

        /// The node replies.
        void answers(std::string_view json) { static_cast<void>(reply.release()->offer(json)); }
        void refuses(std::string_view json) {
            protocol::failure why;
            protocol::parse_failure(json, why);
            reply.release()->refuse(why.code, why.message, json);
        }
        /// The request is not delivered, or no reply arrives.
        void fails(boost::system::error_code code, std::string_view why) { reply.release()->fail(code, why); }
        [[nodiscard]] bool open() const noexcept { return reply != nullptr; }
    };

    std::uint64_t forward(const core::forwarding_permit&, const protocol::outgoing_request& r, time_point deadline,
                          detail::pending_ptr reply, core::outbound::progress_function progress) override {
        return record(r, deadline, std::move(reply), std::move(progress));
    }
    std::uint64_t send_own(const protocol::outgoing_request& r, time_point deadline,
                           detail::pending_ptr reply) override {
        return record(r, deadline, std::move(reply), {});
    }
    std::uint64_t record(const protocol::outgoing_request& r, time_point deadline, detail::pending_ptr reply,
                         core::outbound::progress_function progress) {
        auto made = std::make_unique<sent>();
        made->ticket = ++last_ticket_;
        made->node = r.target();
        made->text = std::string{to_string(r.verb)} + " " + std::string{r.noun};
        for (const auto part : {r.adverbs, r.body}) {
            made->text.append(part.empty() ? "" : " ").append(part);
        }
        auto whole = r;
        whole.id = made->ticket;
        whole.deadline_ms = 1;
        whole.wants_progress = static_cast<bool>(progress);
        protocol::append_request(made->line, whole);
        made->deadline = deadline;
        made->carried = r.carried;
        made->reply = std::move(reply);
        made->progress = std::move(progress);
        all_.push_back(std::move(made));
        return last_ticket_;
    }
    void cancel(std::uint64_t ticket) override {
        for (const auto& s : all_) {
            if (s->ticket == ticket && s->open()) {
                s->cancelled = true;
                s->fails(errc::cancelled, "the request was cancelled");
            }
        }
    }

    /// A noun that is bound at another node.
    struct feed {
        std::string text;                ///< "car2:pose hops=7 via=car1"
        core::feed_events* to = nullptr; ///< null: unbound
        std::uint64_t seq = 0;

        void binds(std::string_view last) const { to->on_bound(last); }
        /// It is bound again at a publisher that names the update of its last value, with a new incarnation.
        std::string binds_again(std::uint64_t number, const std::string& last) {
            const auto line = "UPDATE " + text.substr(0, text.find(' ')) + " seq=" + std::to_string(number) +
                              " epoch=0000cafe " + last;
            to->on_update(line, std::string_view{line}.substr(line.size() - last.size()));
            to->on_bound(last);
            return line + "\n";
        }
        void refuses(errc code, std::string why) {
            std::exchange(to, nullptr)->on_refused({.code = code, .message = std::move(why)});
        }
        /// It publishes; returns the line.
        std::string publishes(const std::string& body) {
            const auto line = "UPDATE " + text.substr(0, text.find(' ')) + " seq=" + std::to_string(++seq) +
                              " epoch=0000beef " + body;
            to->on_update(line, std::string_view{line}.substr(line.size() - body.size()));
            return line + "\n";
        }
    };
    std::shared_ptr<void> bind(const core::forwarding_permit& permit, std::string_view path,
                               core::feed_events& to) override {
        const auto made = std::make_shared<feed>();
        made->text.append(permit.node()).append(":").append(path).append(" ").append(permit.adverbs());
        made->to = &to;
        feeds_.push_back(made);
        return {static_cast<void*>(made.get()), [made](void*) { made->to = nullptr; }};
    }
    /// The newest feed of this noun, whatever its state.
    feed& bound(const std::string& noun) {
        for (auto at = feeds_.rbegin(); at != feeds_.rend(); ++at) {
            if ((*at)->text.starts_with(noun + " ")) {
                return **at;
            }
        }
        throw std::runtime_error{"nobody binds " + noun};
    }
    [[nodiscard]] std::size_t count_bound() const noexcept {
        std::size_t count = 0;
        for (const auto& f : feeds_) {
            count += f->to != nullptr ? 1 : 0;
        }
        return count;
    }

    /// The newest request to this node, whatever its state.
    sent& to(std::string_view node) {
        for (auto at = all_.rbegin(); at != all_.rend(); ++at) {
            if ((*at)->node == node) {
                return **at;
            }
        }
        throw std::runtime_error{"nothing was sent to " + std::string{node}};
    }
    /// The request that has not been answered.
    sent& open() {
        for (const auto& s : all_) {
            if (s->open()) {
                return *s;
            }
        }
        throw std::runtime_error{"nothing is open"};
    }
    [[nodiscard]] std::size_t count() const noexcept { return all_.size(); }
    /// All after the first ones.
    [[nodiscard]] std::vector<std::string> texts_since(std::size_t first) const {
        std::vector<std::string> texts;
        for (auto i = first; i < all_.size(); ++i) {
            texts.push_back(all_[i]->text);
        }
        return texts;
    }
    [[nodiscard]] std::size_t count_open() const noexcept {
        std::size_t count = 0;
        for (const auto& s : all_) {
            count += s->open() ? 1 : 0;
        }
        return count;
    }

  private:
    std::vector<std::unique_ptr<sent>> all_;
    std::vector<std::shared_ptr<feed>> feeds_;
    std::uint64_t last_ticket_ = 0;
};

} // namespace cles::test
