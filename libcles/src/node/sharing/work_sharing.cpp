// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/work_sharing.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "json/json_members.hpp"
#include "node/routing/next_hop.hpp"
#include "node/session/call.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace cles::core {
namespace {

using std::chrono::microseconds;

/// Smooths a measured duration; each new value has a weight of one eighth (RFC 6298, section 2).
void smooth(std::optional<microseconds>& average, microseconds sample) {
    constexpr int weight = 8;
    average = average ? *average + (sample - *average) / weight : sample;
}

microseconds elapsed(time_point since, time_point now) { return std::chrono::duration_cast<microseconds>(now - since); }

std::uint32_t bounded(std::uint64_t count) {
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(count, std::numeric_limits<std::uint32_t>::max()));
}

template <class Write>
std::string object(Write write) {
    std::string text;
    json_writer w{text};
    w.begin_object();
    write(w);
    w.end_object();
    return text;
}

} // namespace

work_sharing::work_sharing(node_state& host, client& out, shareable_queue& jobs, std::uint32_t seed)
    : node_(host), out_(out), jobs_(jobs), draws_(seed) {
    node_.sharing = this;
}

work_sharing::~work_sharing() { node_.sharing = nullptr; }

void work_sharing::withdraw_all() {
    while (!moved_.empty()) {
        withdraw(moved_.begin()->first);
    }
}

// -- requests ------------------------------------------------------------------------------------------------------

std::unique_ptr<const movable_request> work_sharing::movable(const protocol::request_line& r,
                                                             const identity& peer) const {
    const auto* task = r.verb == verb::delegate && r.hops != 0 ? node_.tasks.find(r.verb, r.noun.task) : nullptr;
    if (task == nullptr || task->info.local || task->info.must_be_signed) {
        return nullptr;
    }
    const auto requester = requester_of(node_, peer, r);
    if (!requester.empty() && requester != node_.name && !node_.security->may_forward(node_.name, requester)) {
        return nullptr;
    }
    auto last = r;
    last.hops = 1; // so that it is forwarded with `hops=0`
    std::string scratch;
    return std::make_unique<const movable_request>(
        movable_request{.path = std::string{protocol::canonical_path(r.noun, scratch)},
                        .adverbs = forwarded_adverbs(last, node_.name, requester),
                        .via = std::string{r.via},
                        .requester = std::string{requester}});
}

std::optional<protocol::failure> work_sharing::use_grant(const protocol::request_line& r, const identity& peer,
                                                         time_point now) {
    const auto by = protocol::last_in_via(r.via);
    const auto refused = [&](errc code, const char* why) {
        ++node_.counts.grants_refused;
        return protocol::failure{.code = code, .message = node_.name + ": " + why};
    };
    if (node_.security && by != peer.name) {
        return refused(errc::denied, "this grant is not that of the peer");
    }
    switch (granted_.check(by, r.grant, now)) {
    case slot_grants::verdict::unknown: return refused(errc::denied, "it has not granted this");
    case slot_grants::verdict::over: return refused(errc::busy, "the grant is not valid any more");
    case slot_grants::verdict::valid: break;
    }
    if (jobs_.read_state().free() == 0) {
        return refused(errc::busy, "other jobs have taken the granted slots");
    }
    granted_.use(by);
    return std::nullopt;
}

// The slot of a job that is being answered, unless jobs wait here. So a stream of jobs needs no other messages.
std::string work_sharing::grant_another(std::string_view to) {
    if (jobs_.read_state().waiting != 0) {
        return {};
    }
    auto& other = known_[std::string{to}];
    const bool has_more = other.waiting != 0; // then it will use the slot at once
    other.waiting -= has_more ? 1 : 0;
    return "grant=" + protocol::grant_text(open_grant(to, 1, has_more ? 1 : 0, node_.time.now()));
}

bool work_sharing::read(std::string_view body, std::size_t depth, slots_message& to) {
    json_reader reader{body, depth};
    const bool valid = read_members(reader, [&](std::string_view key) {
        return key == "node"         ? reader.read(to.node)
               : key == "free"       ? reader.read(to.free)
               : key == "waiting"    ? reader.read(to.waiting)
               : key == "service_us" ? reader.read(to.service_us)
                                     : reader.skip();
    });
    return valid && !to.node.empty();
}

std::optional<protocol::failure> work_sharing::refusal(const slots_message& said, const protocol::request_line& r,
                                                       const identity& peer) const {
    const auto refused = [&](errc code, std::string_view why) {
        return protocol::failure{.code = code, .message = node_.name + ": " + std::string{why}};
    };
    if (node_.security && said.node != peer.name) {
        return refused(errc::denied, "'node' is not the peer");
    }
    if (!node_.peers.address_of(said.node)) {
        return refused(errc::bad_request, "'node' is not a node that is known here");
    }
    if (r.grant != 0 && (said.free == 0 || said.free > slot_grants::max_slots)) {
        return refused(errc::bad_request, "a grant is for 1 to 1024 jobs ('free')");
    }
    return std::nullopt;
}

void work_sharing::serve_slots(reply_writer& replies, const protocol::request_line& r, const identity& peer,
                               time_point now) {
    slots_message said;
    if (!read(r.body, node_.bounds.depth, said)) {
        replies.fail(r, errc::bad_request, node_.name + ": the body is not about slots");
        return;
    }
    if (const auto why = refusal(said, r, peer)) {
        replies.fail(r, *why);
        return;
    }
    if (r.grant == 0) {
        auto& other = known_[std::string{said.node}];
        other.waiting = bounded(said.waiting);
        other.heard = now;
        replies.done(reply_target{r}, {});
        balance(now);
        return;
    }
    ++node_.counts.grants_received;
    auto& held = hold(said.node, r.grant, bounded(said.free), now);
    held.work = microseconds{bounded(said.service_us)};
    const auto taken = forward_jobs(std::string{said.node}, held, now);
    const auto waiting = jobs_.read_state().excess();
    replies.done(reply_target{r}, object([&](json_writer& w) {
                     write_member(w, "taken", std::uint64_t{taken});
                     write_member(w, "waiting", std::uint64_t{waiting});
                 }));
}

// -- jobs that leave -----------------------------------------------------------------------------------------------

/// The reply to a moved job.
class work_sharing::moved_reply final : public subrequest {
  public:
    moved_reply(const work_sharing& by, std::uint64_t ticket)
        : subrequest([this](std::string_view json, subrequest_failure* why) {
              if (const auto alive = by_.lock()) {
                  (*alive)->on_outcome(ticket_, json, why);
              }
          }),
          by_(by.alive_), ticket_(ticket) {}

    verdict offer_granted(std::string_view json, std::uint64_t grant) override {
        if (const auto alive = by_.lock(); alive && detail::is_valid_answer(json)) {
            (*alive)->hold_another(ticket_, grant);
        }
        return offer(json);
    }

  private:
    const std::weak_ptr<work_sharing*> by_; // which may have ended
    const std::uint64_t ticket_;
};

/// Chooses the jobs to forward on one grant, and forwards them.
class work_sharing::forwarding final : public job_taker {
  public:
    forwarding(work_sharing& by, const std::string& node, const held_grant& grant, time_point now)
        : by_(by), node_(node), grant_(grant), now_(now), own_(by.jobs_.read_state()) {
        const auto slower = std::max(grant.work - own_.service_time, microseconds{0});
        const std::chrono::duration<double, std::micro> transfer{by.transfer_to(node_)};
        required_wait_ = worth * transfer + slower;
    }

    [[nodiscard]] bool full() const noexcept override { return wanted_ == grant_.left; }

    bool wants(const call& job, std::size_t ahead) override {
        if (job.ended() || job.movable() == nullptr || !is_worth_it(ahead)) {
            return false;
        }
        const auto& r = *job.movable();
        const auto task = std::string_view{r.path}.substr(0, r.path.find('/'));
        const bool may_go =
            offers(task) && !is_in_via(r.via, node_) && permits(by_.node_, r.requester, node_, verb::delegate, r.path);
        wanted_ += may_go ? 1 : 0;
        return may_go;
    }

    std::uint64_t take(std::shared_ptr<call> job, std::string_view body,
                       std::function<void(bool refused)> ended) override {
        const auto& r = *job->movable();
        const auto noun = node_ + ":" + r.path;
        const auto adverbs = r.adverbs + " grant=" + protocol::grant_text(grant_.number);
        const auto ticket = ++by_.last_ticket_;
        const auto request =
            by_.out_.forward({.verb = verb::delegate,
                              .noun = noun,
                              .carried = job->wanted().carried(),
                              .adverbs = adverbs,
                              .body = body},
                             job->due(), detail::pending_ptr{new moved_reply(by_, ticket)}, progress_to(job));
        job->leave_to_others();
        ++by_.node_.counts.jobs_moved_out;
        by_.moved_.emplace(ticket, moved_job{.job = std::move(job),
                                             .ended = std::move(ended),
                                             .node = node_,
                                             .request = request,
                                             .sent = now_,
                                             .work = grant_.work});
        ++taken_;
        return ticket;
    }

    [[nodiscard]] unsigned taken() const noexcept { return taken_; }

  private:
    // The first one for which there is no worker waits for half a job on average.
    [[nodiscard]] bool is_worth_it(std::size_t ahead) const noexcept {
        if (ahead < own_.idle) {
            return false;
        }
        const std::chrono::duration<double, std::micro> each{own_.service_time};
        const auto turns = static_cast<double>(ahead - own_.idle) + 0.5;
        return each * turns / std::max<std::uint32_t>(own_.workers, 1) > required_wait_;
    }
    [[nodiscard]] bool offers(std::string_view task) {
        if (task != last_task_) { // most jobs are of one task
            last_task_ = task;
            last_is_offered_ = by_.out_.offers(node_, task);
        }
        return last_is_offered_;
    }

    work_sharing& by_;
    const std::string& node_;
    const held_grant grant_;
    const time_point now_;
    const shareable_queue::state own_;
    std::chrono::duration<double, std::micro> required_wait_{};
    std::string last_task_;
    bool last_is_offered_ = false;
    unsigned wanted_ = 0;
    unsigned taken_ = 0;
};

unsigned work_sharing::forward_jobs(const std::string& node, held_grant& by, time_point now) {
    forwarding on_grant{*this, node, by, now};
    jobs_.offer(on_grant);
    by.left -= on_grant.taken();
    return on_grant.taken();
}

void work_sharing::use_held_grants(time_point now) {
    std::erase_if(held_, [&](const auto& one) { return one.second.left == 0 || now >= one.second.expires; });
    for (auto& [node, grant] : held_) {
        forward_jobs(node, grant, now);
    }
}

// The node to which that job was moved has granted another slot.
void work_sharing::hold_another(std::uint64_t ticket, std::uint64_t grant) {
    if (const auto found = moved_.find(ticket); found != moved_.end()) {
        const auto& moved = found->second;
        ++node_.counts.grants_received;
        hold(moved.node, grant, 1, node_.time.now()).work = moved.work;
    }
}

// A grant that has not expired may be extended.
work_sharing::held_grant& work_sharing::hold(std::string_view by, std::uint64_t number, unsigned slots,
                                             time_point now) {
    auto& held = held_[std::string{by}];
    if (held.number != number || now >= held.expires) {
        held = {.number = number};
    }
    held.left = std::min(held.left + slots, slot_grants::max_slots);
    held.expires = now + slot_grants::valid_for;
    return held;
}

microseconds work_sharing::transfer_to(std::string_view node) const {
    const auto found = known_.find(node);
    if (found == known_.end()) {
        return first_transfer;
    }
    const auto& other = found->second;
    const auto trip = other.trip.value_or(first_transfer);
    return std::max(trip, other.surplus.value_or(microseconds{0}));
}

// A failure that says that the job has not begun returns it to the queue; anything else is its reply.
void work_sharing::on_outcome(std::uint64_t ticket, std::string_view json, subrequest_failure* why) {
    const auto found = moved_.find(ticket);
    if (found == moved_.end()) {
        return; // withdrawn
    }
    const auto moved = std::move(found->second);
    moved_.erase(found);
    const auto& job = moved.job;
    if (why != nullptr && !why->may_have_started && !job->ended()) {
        --node_.counts.jobs_moved_out;
        job->take_back();
        held_.erase(moved.node); // it has no more free workers
        moved.ended(true);
        balance(node_.time.now());
        return;
    }
    if (why == nullptr) {
        smooth(known_[moved.node].surplus, elapsed(moved.sent, node_.time.now()) - moved.work);
        job->done(json);
    } else {
        job->fail(named(std::move(*why), moved.node));
    }
    moved.ended(false);
    balance(node_.time.now()); // there may be another slot
}

void work_sharing::withdraw(std::uint64_t ticket) {
    if (const auto found = moved_.find(ticket); found != moved_.end()) {
        const auto request = found->second.request;
        const auto keep = std::move(found->second); // released after the request
        moved_.erase(found);
        out_.cancel(request);
    }
}

// -- slots and jobs are brought together ---------------------------------------------------------------------------

void work_sharing::on_change() { balance(node_.time.now()); }

void work_sharing::on_deadline(time_point now) { balance(now); }

void work_sharing::balance(time_point now) {
    auto own = jobs_.read_state();
    if (own.excess() != 0 && !held_.empty()) {
        use_held_grants(now);
        own = jobs_.read_state();
    }
    if (own.excess() != 0) {
        tell(own.excess(), now);
    } else if (const auto reserved = granted_.reserved(now); own.free() > reserved) {
        look_at_loads(now);
        grant_slots(own.free() - reserved, own, now);
    }
    follow(own, now);
}

// What a node has said since it last reported its load is newer.
void work_sharing::look_at_loads(time_point now) {
    if (now < look_at_) {
        return;
    }
    look_at_ = now + look_every;
    list_neighbours();
    for (const auto& other : neighbours_) {
        if (other.load.queued != 0) {
            auto& about = known_[std::string{other.name}];
            about.waiting = about.heard < other.seen ? other.load.queued : about.waiting;
        }
    }
}

// The most loaded ones first, each for the jobs that it may have.
void work_sharing::grant_slots(unsigned slots, const shareable_queue::state& own, time_point now) {
    slots = std::min(slots, slot_grants::max_slots);
    while (slots != 0) {
        const std::string* most_loaded = nullptr;
        std::uint32_t waiting = 0;
        for (const auto& [name, other] : known_) {
            if (other.waiting > waiting && granted_.reserved_for(name, now) == 0) {
                most_loaded = &name;
                waiting = other.waiting;
            }
        }
        if (most_loaded == nullptr) {
            return;
        }
        const auto given = std::min<unsigned>(slots, waiting);
        slots -= given;
        known_.find(*most_loaded)->second.granted = given;
        push(*most_loaded, open_grant(*most_loaded, given, given, now), object([&](json_writer& w) {
            write_member(w, "node", std::string_view{node_.name});
            write_member(w, "free", std::uint64_t{given});
            write_member(w, "service_us", static_cast<std::uint64_t>(own.service_time.count()));
        }),
             now);
    }
}

std::uint64_t work_sharing::open_grant(std::string_view to, unsigned slots, unsigned reserved, time_point now) {
    const auto number = (std::uint64_t{out_.random()} << 32U | out_.random()) | 1U;
    ++node_.counts.grants_sent;
    return granted_.open(to, number, slots, reserved, now);
}

// Nodes that seem to have a free worker first; the others may have become free since they reported their load. From a
// random one on, so that all get to know it.
void work_sharing::tell(std::uint32_t waiting, time_point now) {
    if (now < tell_at_) {
        return;
    }
    tell_at_ = now + tell_every;
    list_neighbours();
    std::erase_if(neighbours_, [](const neighbour& other) { return other.load.workers == 0; });
    if (neighbours_.empty()) {
        return;
    }
    std::rotate(neighbours_.begin(),
                neighbours_.begin() + static_cast<std::ptrdiff_t>(draws_.below(neighbours_.size())), neighbours_.end());
    std::stable_partition(neighbours_.begin(), neighbours_.end(), [](const neighbour& other) {
        return other.load.queued + other.load.running < other.load.workers;
    });
    const auto body = object([&](json_writer& w) {
        write_member(w, "node", std::string_view{node_.name});
        write_member(w, "waiting", std::uint64_t{waiting});
    });
    for (std::size_t i = 0; i < std::min(told_at_once, neighbours_.size()); ++i) {
        push(neighbours_[i].name, 0, body, now);
    }
}

void work_sharing::push(std::string_view node, std::uint64_t grant, const std::string& body, time_point now) {
    known_[std::string{node}].asked = now;
    out_.push_slots(node, grant, body);
}

void work_sharing::on_reply(std::string_view node, std::uint64_t grant, std::string_view json, time_point now) {
    const auto found = known_.find(node);
    if (found == known_.end()) {
        return;
    }
    auto& other = found->second;
    std::uint64_t taken = 0;
    std::uint64_t waiting = 0;
    if (!json.empty()) {
        smooth(other.trip, elapsed(other.asked, now));
        json_reader reader{json, node_.bounds.depth};
        read_members(reader, [&](std::string_view key) {
            return key == "taken" ? reader.read(taken) : key == "waiting" ? reader.read(waiting) : reader.skip();
        });
    }
    if (grant == 0) {
        return;
    }
    other.granted -= std::min<unsigned>(other.granted, bounded(taken));
    granted_.unreserve(node, grant, std::exchange(other.granted, 0));
    // Those that it does not give are not for this node, or not worth a transfer: until it reports jobs again.
    other.waiting = taken == 0 ? 0 : bounded(waiting);
    other.heard = now;
    balance(now);
}

void work_sharing::list_neighbours() {
    neighbours_.clear();
    out_.list_neighbours(neighbours_);
    std::erase_if(known_, [&](const auto& one) {
        const bool gone = !node_.peers.address_of(one.first);
        if (gone) {
            granted_.forget(one.first);
            held_.erase(one.first);
        }
        return gone;
    });
}

// What may change without an event here: jobs are to be reported again, a grant expires, others report their loads.
void work_sharing::follow(const shareable_queue::state& own, time_point now) {
    std::optional<time_point> next;
    if (own.excess() != 0) {
        next = tell_at_;
    } else if (own.free() != 0) {
        next = look_at_;
        if (const auto expiry = granted_.next_expiry(now)) {
            next = std::min(*next, *expiry);
        }
    }
    if (next) {
        node_.deadlines.arm(*this, std::max(*next, now + std::chrono::milliseconds{1}));
    } else {
        node_.deadlines.disarm(*this);
    }
}

} // namespace cles::core
