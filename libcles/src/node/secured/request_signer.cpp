// SPDX-License-Identifier: BSL-1.0
#include "node/secured/request_signer.hpp"

#include "json/json_members.hpp"
#include "node/base/peer_reply.hpp"
#include "node/base/wrapped_operation.hpp"
#include "node/local_node.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace cles::core {
namespace {

/// What is needed to send a request once more.
struct repeatable_request {
    std::weak_ptr<local_node> host;
    std::weak_ptr<request_signer> signer; // nothing: the node has stopped
    verb how = verb::pull;
    std::string target;
    std::string path;
    std::string body;
    std::string at;
    std::string at_node;
    protocol::carried_adverbs carried{};
    std::uint32_t hops = protocol::default_hops;
    outbound::progress_function progress;
    time_point deadline{};
    std::uint64_t ticket = 0;
};

// A node could have anything signed under the name of another.
bool may_sign_for(local_node& host, const repeatable_request& r, const std::string& node) {
    const auto& own = host.node().name;
    if (!protocol::is_name(node) || protocol::is_reserved_target(node)) {
        return false;
    }
    if (r.target == "self") {
        return r.at.empty() && node == own;
    }
    const auto member = member_of(host.node(), r.target);
    if (member == "any" || member == "all") {
        return permits(host.node(), {.requester = own}, node, r.how, r.path);
    }
    return node == member;
}

// How long this node goes on waiting. At least 1 ms, which requests state at least.
std::uint32_t waits_ms(const repeatable_request& r, time_point now) {
    const auto left = std::chrono::floor<std::chrono::milliseconds>(r.deadline - now).count();
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(left, 1, std::int64_t{protocol::max_deadline_ms}));
}

// Where a node is reached that a request for `target` has led to: in the pool that was named, since its name alone may
// not be known here.
std::string address_in_pool(local_node& host, const std::string& target, const std::string& node) {
    const auto member = member_of(host.node(), target);
    return protocol::is_reserved_target(member) ? target.substr(0, target.size() - member.size()) + node : target;
}

/// The node that has asked for a signature with this failure, if it may get one; else nothing. `sig` is the value of
/// `sig=`.
std::optional<std::string> signing_node(local_node& host, const repeatable_request& r, std::string_view answer,
                                        std::string& sig) {
    protocol::failure why;
    if (!protocol::is_failure(answer) || !protocol::parse_failure(answer, why) || why.code != errc::denied ||
        why.challenge.empty() || !may_sign_for(host, r, why.node)) {
        return {};
    }
    protocol::noun_view noun;
    std::string unused;
    const auto whole = why.node + ":" + r.path;
    if (!protocol::parse_noun(whole, noun, unused)) {
        return {};
    }
    std::string scratch;
    const auto waits = waits_ms(r, host.node().time.now());
    const auto made = host.node().security->sign_request(why.node, why.challenge, r.how,
                                                         protocol::canonical_path(noun, scratch), r.body, waits);
    sig = protocol::request_signature_text({.signature = made, .waits_ms = waits});
    return made.empty() ? std::nullopt : std::optional{std::move(why.node)};
}

void send_signed(local_node& host, request_signer& by, const repeatable_request& r, const std::string& node,
                 std::string_view sig, detail::pending_ptr reply, outbound::progress_function progress) {
    const auto to = address_in_pool(host, r.target, node);
    const auto noun = to + ":" + r.path;
    const auto adverbs = std::string{"sig="}.append(sig);
    host.flush_scheduler().run_user_call([&] {
        const auto id = host.peer_channels().send(
            {.target = to, .at = r.at, .expected = r.at_node},
            {.verb = r.how, .noun = noun, .carried = r.carried, .hops = r.hops, .adverbs = adverbs, .body = r.body},
            r.deadline, std::move(reply), std::move(progress));
        if (id != 0) {
            by.note(r.ticket, id);
        }
    });
}

/// Ends the entry of a request in the signer.
class noted_ticket {
  public:
    noted_ticket(std::weak_ptr<request_signer> by, std::uint64_t ticket) : by_(std::move(by)), ticket_(ticket) {}
    noted_ticket(const noted_ticket&) = delete;
    noted_ticket& operator=(const noted_ticket&) = delete;
    ~noted_ticket() {
        if (const auto signer = by_.lock()) {
            signer->forget(ticket_);
        }
    }

  private:
    std::weak_ptr<request_signer> by_;
    std::uint64_t ticket_;
};

/// The reply to a request for `all` while nodes in it are asked once more, with the signature.
class gathered_reply {
  public:
    explicit gathered_reply(const repeatable_request& r) : host_(r.host), ticket_(r.signer, r.ticket) {}
    gathered_reply(const gathered_reply&) = delete;
    gathered_reply& operator=(const gathered_reply&) = delete;

    /// Reads the reply to the first attempt. False if it has another form.
    bool read(std::string_view json) {
        json_reader r{json, detail::answer_depth};
        const auto take = [&r](outcomes& into) {
            return read_members(r, [&](std::string_view key) {
                const std::string node{key};
                std::string_view raw;
                return r.read_raw(raw) && into.insert_or_assign(node, std::string{raw}).second;
            });
        };
        return read_members(r,
                            [&](std::string_view key) {
                                return key == "results" ? take(results_) : key == "errors" ? take(errors_) : r.skip();
                            }) &&
               r.at_end();
    }
    [[nodiscard]] const std::map<std::string, std::string>& errors() const noexcept { return errors_; }
    /// Completes `operation` after this many outcomes.
    void take(detail::pending_ptr operation, std::size_t open) noexcept {
        operation_ = std::move(operation);
        open_ = open;
    }
    void on_outcome(const std::string& node, const peer_answer& found) {
        const auto host = host_.lock();
        if (!found.code && detail::is_valid_part(found.json)) {
            errors_.erase(node);
            results_.insert_or_assign(node, std::string{found.json});
        } else if (!found.code) {
            errors_.insert_or_assign(
                node, failure_text({.code = errc::failed, .message = node + ": the answer is nested too deeply"}));
        } else if (!found.refusal.empty()) {
            errors_.insert_or_assign(node, std::string{found.refusal});
        } else if (found.code == errc::cancelled) {
            if (host && operation_) {
                host->completions().fail(std::move(operation_), errc::cancelled, found.message);
            }
            return;
        } else {
            const bool ours = found.code.category() == error_category();
            errors_.insert_or_assign(
                node, failure_text({.code = ours ? static_cast<errc>(found.code.value()) : errc::unavailable,
                                    .message = node + ": " + std::string{found.message}}));
        }
        if (--open_ == 0 && host && operation_) {
            host->completions().succeed(std::move(operation_), text());
        }
    }

  private:
    using outcomes = std::map<std::string, std::string>;

    static std::string members(const outcomes& all) {
        std::string text;
        for (const auto& [node, json] : all) {
            begin_member(text, node); // named by the node that has gathered them
            text.append(json);
        }
        return text;
    }
    [[nodiscard]] std::string text() const {
        return R"({"results":{)" + members(results_) + R"(},"errors":{)" + members(errors_) + "}}";
    }

    std::weak_ptr<local_node> host_;
    noted_ticket ticket_;
    detail::pending_ptr operation_;
    outcomes results_;
    outcomes errors_;
    std::size_t open_ = 0;
};

/// One attempt of a request: completes its operation, unless it is the first one and the reply asks for a signature.
class attempt_of_request final : public wrapped_operation {
  public:
    attempt_of_request(repeatable_request r, detail::pending_ptr operation)
        : wrapped_operation(std::move(operation)), request_(std::move(r)) {}
    /// The second one. Whatever its outcome is, there is no third.
    attempt_of_request(std::weak_ptr<request_signer> signer, std::uint64_t ticket, detail::pending_ptr operation)
        : wrapped_operation(std::move(operation)), repeated_(std::in_place, std::move(signer), ticket) {}

    verdict offer(std::string_view json) override {
        std::unique_ptr<attempt_of_request> self{this};
        if (!repeated_ && request_.target == "all" && gather(json)) {
            return verdict::completed;
        }
        static_cast<void>(self.release());
        return wrapped_operation::offer(json);
    }
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override {
        const std::unique_ptr<attempt_of_request> self{this};
        if (repeated_ || code != errc::denied || !repeat(answer)) {
            take_operation().release()->refuse(code, message, answer);
        }
    }

  private:
    bool repeat(std::string_view answer) {
        const auto host = request_.host.lock();
        const auto signer = request_.signer.lock();
        if (!host || !signer) {
            return false;
        }
        std::string sig;
        const auto node = signing_node(*host, request_, answer, sig);
        if (!node) {
            return false;
        }
        detail::pending_ptr second{new attempt_of_request(request_.signer, request_.ticket, take_operation())};
        send_signed(*host, *signer, request_, *node, sig, std::move(second), std::move(request_.progress));
        return true;
    }

    bool gather(std::string_view json) {
        const auto host = request_.host.lock();
        const auto signer = request_.signer.lock();
        if (!host || !signer || json.find(R"("challenge":)") == std::string_view::npos) {
            return false;
        }
        auto whole = std::make_shared<gathered_reply>(request_);
        if (!whole->read(json)) {
            return false;
        }
        std::map<std::string, std::string> signatures;
        std::set<std::string, std::less<>> members; // a second signature would let a member run the request twice
        for (const auto& [node, error] : whole->errors()) {
            const auto member = member_of(host->node(), node);
            std::string sig;
            if (protocol::is_name(node) && !members.contains(member) &&
                signing_node(*host, request_, error, sig) == member) {
                members.emplace(member);
                signatures.emplace(node, std::move(sig));
            }
        }
        if (signatures.empty()) {
            return false;
        }
        whole->take(take_operation(), signatures.size());
        for (const auto& [node, sig] : signatures) {
            auto then = [whole, node = node](const peer_answer& found) { whole->on_outcome(node, found); };
            send_signed(*host, *signer, request_, node, sig, detail::pending_ptr{new peer_reply{std::move(then), true}},
                        {});
        }
        return true;
    }

    repeatable_request request_{};
    std::optional<noted_ticket> repeated_; // of the second attempt only
};

} // namespace

detail::pending_ptr request_signer::watch(const outgoing_call& r, detail::pending_ptr operation) {
    if (r.noun.task == "cles") { // never signed
        return operation;
    }
    return detail::pending_ptr{new attempt_of_request(repeatable_request{.host = host_.weak_from_this(),
                                                                         .signer = weak_from_this(),
                                                                         .how = r.how,
                                                                         .target = std::string{r.noun.target},
                                                                         .path = std::string{r.noun.path},
                                                                         .body = std::string{protocol::trim(r.body)},
                                                                         .at = r.options.at_,
                                                                         .at_node = r.options.at_node_,
                                                                         .carried = r.carried,
                                                                         .hops = r.options.hops_,
                                                                         .progress = r.options.on_progress_,
                                                                         .deadline = r.deadline,
                                                                         .ticket = r.ticket},
                                                      std::move(operation))};
}

bool request_signer::cancel(std::uint64_t ticket) {
    const auto found = repeated_.find(ticket);
    if (found == repeated_.end()) {
        return false;
    }
    for (const auto id : std::vector{found->second}) { // each may end the entry
        host_.cancel_sent(id);
    }
    return true;
}

} // namespace cles::core
