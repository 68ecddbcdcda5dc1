// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/work_sharing.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "json/json_members.hpp"
#include "node/membership/announcement.hpp"
#include "node/routing/next_hop.hpp"
#include "node/session/call.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"

#include <algorithm>
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

/// How long a node should wait that has no free worker for a job on a grant: its next grant may come at once.
constexpr std::chrono::milliseconds next_slot_retry{1};

std::string_view task_of(const movable_request& r) { return r.path().substr(0, r.path().find('/')); }

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

// A job that came on a grant stays: it moves once.
std::optional<movable_request> work_sharing::movable(const protocol::request_line& r, const task_info& task,
                                                     const identity& peer) {
    if (r.verb != verb::delegate || r.hops == 0 || r.grant != 0 || r.text.size() > longest_moved || task.local ||
        task.must_be_signed || is_part_of_all(r)) {
        return std::nullopt;
    }
    const auto by = origin_of(node_, peer, r);
    if (!may_forward_for(by.requester)) {
        return std::nullopt;
    }
    adverb_list adverbs;
    if (has_adverbs_to_forward(r)) {
        adverbs = forwarded_adverbs(r, 0, node_.name, by);
        if (adverbs.count == max_further_adverbs(r)) { // no room for `grant`
            return std::nullopt;
        }
    }
    std::string scratch;
    return movable_request{{.path = protocol::canonical_path(r.noun, scratch),
                            .via = r.via,
                            .by = by,
                            .adverbs = adverbs.text,
                            .size = r.text.size()}};
}

bool work_sharing::may_forward_for(std::string_view requester) {
    if (requester.empty() || core::may_forward_for(node_, requester)) {
        return true;
    }
    const auto* const others = out_.registry();
    if (!has_logged_why_ && others != nullptr && !others->nodes().empty()) {
        has_logged_why_ = true;
        const std::string who{requester};
        node_.post_log(log_level::info, "jobs of " + who + " do not move to other nodes, because " + node_.name +
                                            " may not forward for it " +
                                            how_to_permit_forwarding(node_.name, requester));
    }
    return false;
}

bool work_sharing::may_move(const call& job) const noexcept { return job.movable() != nullptr; }

std::optional<protocol::failure> work_sharing::use_grant(const protocol::request_line& r, const task_info& task,
                                                         const identity& peer, time_point now) {
    const auto by = protocol::last_in_via(r.via);
    const auto refused = [&](errc code, const std::string& why) {
        ++node_.counts.granted_jobs_refused;
        return protocol::failure{.code = code, .message = node_.name + " " + why};
    };
    const auto busy = [&](const std::string& why) {
        auto failure = refused(errc::busy, why);
        failure.retry_ms = static_cast<std::uint64_t>(next_slot_retry.count());
        return failure;
    };
    if (node_.security && by != peer.name) {
        return refused(errc::denied, "has not granted this: the last node in 'via' is not the peer");
    }
    granted_.arrived(by, r.grant, now); // even if it is refused: its sender uses no other slot for it
    if (task.local) {
        return refused(errc::no_task, "takes no jobs of '" + std::string{r.noun.task} + "' from other nodes");
    }
    if (task.must_be_signed) {
        return refused(errc::denied,
                       "takes no jobs of '" + std::string{r.noun.task} + "' from other nodes: they are signed");
    }
    switch (granted_.check(by, r.grant, now)) {
    case slot_grants::verdict::unknown: {
        auto failure = refused(errc::denied, "has not granted " + protocol::grant_text(r.grant) + " to " +
                                                 (by.empty() ? "the sender, which is not in 'via'" : std::string{by}));
        failure.retry_ms = 1; // it is about this grant, which somebody else has made up, and not about the task
        return failure;
    }
    case slot_grants::verdict::over: return busy("has no slot left for this: the grant has expired, or is used up");
    case slot_grants::verdict::valid: break;
    }
    if (jobs_.read_state().free() == 0) {
        return busy("has no free worker any more");
    }
    granted_.use(by);
    return std::nullopt;
}

// The slot of a job that is being answered, unless jobs wait here, or more jobs at another node than there. So a stream
// of jobs needs no other messages.
std::string work_sharing::grant_another(std::string_view to) {
    const auto now = node_.time.now();
    if (const auto own = jobs_.read_state(); own.waiting != 0 || own.workers == 0 || own.draining) {
        return {};
    }
    auto& other = known_[std::string{to}];
    if (const auto* first = most_loaded(); first != nullptr && first->second.waiting > other.waiting) {
        return {};
    }
    const auto number = open_grant(to, 1, now);
    if (other.waiting != 0) { // then it will use the slot at once
        --other.waiting;
        granted_.reserve(to, 1, reserve_until(other, now), now);
    }
    return "grant=" + protocol::grant_text(number);
}

// There is no reply that says whether the slot is used.
time_point work_sharing::reserve_until(const acquaintance& other, time_point now) const {
    const auto span = other.trip ? 2 * *other.trip + reserved_for : microseconds{slot_grants::valid_for};
    return now + std::min<microseconds>(span, slot_grants::valid_for);
}

bool work_sharing::read(std::string_view body, std::size_t depth, slots_message& to) {
    json_reader reader{body, depth};
    const bool valid = read_members(reader, [&](std::string_view key) {
        return key == "node"      ? reader.read(to.node)
               : key == "free"    ? read_count(reader, to.free)
               : key == "waiting" ? read_count(reader, to.waiting)
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
    if (find_neighbour(said.node) == nullptr) {
        return refused(errc::bad_request, "'node' is not a node to which this one has a link by a stream");
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
        replies.fail(r, errc::bad_request, node_.name + ": the body needs 'node', and 'free' or 'waiting'");
        return;
    }
    if (const auto why = refusal(said, r, peer)) {
        replies.fail(r, *why);
        return;
    }
    auto& other = known_[std::string{said.node}];
    other.silent_until = time_point::min();
    if (r.grant == 0) {
        other.waiting = said.waiting;
        other.heard = now;
        replies.done(reply_target{r}, {});
        balance(now);
        return;
    }
    ++node_.counts.grants_received;
    auto& held = hold(said.node, r.grant, said.free, now);
    const auto taken = forward_jobs(std::string{said.node}, held, now);
    const bool may_have_more = taken != 0 && held.left == 0;
    const auto waiting = may_have_more ? jobs_.read_state().excess() : 0;
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
    forwarding(work_sharing& by, const std::string& node, const held_grant& grant, const shareable_queue::state& own,
               time_point now)
        : by_(by), node_(node), other_(by.known_[node]), grant_(grant), now_(now), own_(own),
          trip_(other_.trip.value_or(first_transfer)) {}

    [[nodiscard]] bool full() const noexcept override { return chosen_ == grant_.left; }

    bool choose(const call& job, std::size_t ahead, microseconds service_time) override {
        if (job.ended() || job.movable() == nullptr) {
            return false;
        }
        const auto task = task_of(*job.movable());
        if (task != last_task_) { // most jobs are of one task
            look_up(task);
        }
        const bool chosen = is_worth_it(ahead, service_time);
        if ((!chosen && has_suitable_) || !is_suitable(*job.movable())) {
            return false;
        }
        has_suitable_ = true;
        chosen_ += chosen ? 1 : 0;
        return chosen;
    }

    std::uint64_t take(std::shared_ptr<call> job, std::string_view body,
                       std::function<void(bool refused)> ended) override {
        const auto& r = *job->movable();
        const auto noun = node_ + ":" + std::string{r.path()};
        auto adverbs = std::string{r.adverbs()};
        if (adverbs.empty()) {
            adverbs = forwarded_adverbs({}, 0, by_.node_.name, r.origin()).text;
        }
        adverbs.append(" grant=").append(protocol::grant_text(grant_.number));
        const auto ticket = ++by_.last_ticket_;
        auto reply = detail::pending_ptr{new moved_reply(by_, ticket)};
        job->leave_to_others();
        auto& moved = by_.moved_
                          .emplace(ticket, moved_job{.job = std::move(job),
                                                     .ended = std::move(ended),
                                                     .node = node_,
                                                     .grant = grant_.number,
                                                     .request = 0,
                                                     .sent = now_})
                          .first->second;
        ++taken_;
        protocol::failure why;
        const auto permit = forwarding_permit::ask(by_.node_, r.origin(), node_, verb::delegate, r.path(), r.via(),
                                                   std::move(adverbs), why);
        if (!permit) { // although it was chosen: it returns to the queue
            by_.node_.completions.put(completion{completion::failure{std::move(reply), why.code, why.message}});
            return ticket;
        }
        moved.request = by_.out_.forward(*permit,
                                         {.verb = verb::delegate,
                                          .noun = noun,
                                          .carried = moved.job->wanted().carried(),
                                          .adverbs = permit->adverbs(),
                                          .body = body},
                                         moved.job->due(), std::move(reply), progress_to(moved.job));
        return ticket;
    }

    [[nodiscard]] unsigned taken() const noexcept { return taken_; }
    /// Whether one of the jobs is for that node, worth a transfer or not.
    [[nodiscard]] bool has_suitable() const noexcept { return has_suitable_; }
    /// Until when none is, if no more jobs come.
    [[nodiscard]] time_point unsuitable_until() const noexcept { return std::min(now_ + look_every, retry_at_); }

  private:
    void look_up(std::string_view task) {
        last_task_ = task;
        const auto* const other = by_.find_neighbour(node_);
        const auto tasks = other != nullptr ? other->tasks : nullptr;
        last_is_offered_ =
            tasks && std::ranges::any_of(tasks->entries, [&](const task_list::entry& each) {
                return each.verb == verb::delegate && each.task == task && !each.local && !each.must_be_signed;
            });
        const auto known = other_.tasks.find(task);
        last_ = known != other_.tasks.end() ? known->second : task_there{};
    }
    [[nodiscard]] bool is_suitable(const movable_request& r) {
        if (!last_is_offered_ || r.size() > other_.longest || is_in_via(r.via(), node_) ||
            may_pass_on(by_.node_, r.origin(), node_, verb::delegate, r.path()) != passage::permitted) {
            return false;
        }
        const bool refused = now_ < last_.refused_until;
        retry_at_ = refused ? std::min(retry_at_, last_.refused_until) : retry_at_;
        return !refused;
    }
    // The first one for which there is no worker waits for half a job on average. What lies before it in the queue is
    // estimated by what jobs have lately taken, or by those of its task if these take longer.
    [[nodiscard]] bool is_worth_it(std::size_t ahead, microseconds service_time) const noexcept {
        if (ahead < own_.idle) {
            return false;
        }
        const std::chrono::duration<double, std::micro> each{std::max(own_.service_time, service_time)};
        const auto turns = static_cast<double>(ahead - own_.idle) + 0.5;
        return each * turns / std::max<std::uint32_t>(own_.workers, 1) >
               min_wait_per_transfer * trip_ + slower(service_time);
    }
    // What a job of the last task takes longer there, as far as both are known.
    [[nodiscard]] microseconds slower(microseconds service_time) const noexcept {
        const bool known = last_.duration && now_ < last_.duration_until && service_time.count() != 0;
        return known ? std::max(*last_.duration - trip_ - service_time, microseconds{0}) : microseconds{0};
    }

    work_sharing& by_;
    const std::string& node_;
    const acquaintance& other_;
    const held_grant grant_;
    const time_point now_;
    const shareable_queue::state own_;
    const microseconds trip_;
    std::string last_task_;
    bool last_is_offered_ = false;
    task_there last_;
    time_point retry_at_ = time_point::max();
    bool has_suitable_ = false;
    unsigned chosen_ = 0;
    unsigned taken_ = 0;
};

// The queue is searched again only when more jobs have come. If no job is for that node, the grant is dropped.
unsigned work_sharing::forward_jobs(const std::string& node, held_grant& by, time_point now) {
    const auto own = jobs_.read_state();
    if (own.excess() == 0 || now >= by.expires || by.searched == own.movable_queued) {
        return 0;
    }
    by.searched = own.movable_queued;
    forwarding on_grant{*this, node, by, own, now};
    jobs_.offer(on_grant);
    if (!on_grant.has_suitable()) {
        auto& other = known_[node];
        other.unsuitable = own.movable_queued;
        other.unsuitable_until = on_grant.unsuitable_until();
    }
    by.left = on_grant.has_suitable() ? by.left - on_grant.taken() : 0;
    return on_grant.taken();
}

void work_sharing::use_held_grants(time_point now) {
    std::erase_if(held_, [&](const auto& one) { return one.second.left == 0 || now >= one.second.expires; });
    for (auto& [key, grant] : held_) {
        forward_jobs(key.first, grant, now);
    }
}

// The node to which that job was moved has granted another slot.
void work_sharing::hold_another(std::uint64_t ticket, std::uint64_t grant) {
    if (const auto found = moved_.find(ticket); found != moved_.end()) {
        ++node_.counts.grants_received;
        hold(found->second.node, grant, 1, node_.time.now());
    }
}

// A grant that has not expired may be extended. A job has to arrive before it expires, and it has taken as long to
// come.
work_sharing::held_grant& work_sharing::hold(std::string_view by, std::uint64_t number, unsigned slots,
                                             time_point now) {
    const std::pair key{std::string{by}, number};
    if (!held_.contains(key)) {
        make_room_for_grant(key.first);
    }
    auto& held = held_[key];
    if (now >= held.expires) {
        held = {.number = number};
    }
    held.left = std::min(held.left + slots, slot_grants::max_slots);
    held.searched = 0;
    held.expires = now + slot_grants::valid_for - known_[std::string{by}].trip.value_or(microseconds{0});
    return held;
}

// Nobody knows who has sent a grant without security: so a further one of the same node replaces no other, unless there
// are many.
void work_sharing::make_room_for_grant(const std::string& of) {
    auto oldest = held_.end();
    std::size_t known = 0;
    for (auto at = held_.lower_bound({of, 0}); at != held_.end() && at->first.first == of; ++at) {
        ++known;
        oldest = oldest == held_.end() || at->second.expires < oldest->second.expires ? at : oldest;
    }
    if (known >= max_held) {
        held_.erase(oldest);
    }
}

// Until the reply. The node's own average would be of all its tasks, and from any time.
void work_sharing::measure(const moved_job& moved, time_point now) {
    const auto found = known_.find(moved.node);
    if (found == known_.end()) {
        return;
    }
    auto& there = found->second.tasks[std::string{task_of(*moved.job->movable())}];
    if (now >= there.duration_until) {
        there.duration.reset();
    }
    smooth(there.duration, elapsed(moved.sent, now));
    there.duration_until = now + duration_valid_for;
}

// So that the job is not sent there again at once.
void work_sharing::remember_refusal(const moved_job& moved, const protocol::failure& why, time_point now) {
    const bool is_about_grant = why.code == errc::denied && why.retry_ms;
    if (why.code == errc::busy || is_about_grant) {
        held_.erase({moved.node, moved.grant}); // it has no more free workers, or has not granted this
    }
    if (is_about_grant) {
        return;
    }
    const auto found = known_.find(moved.node);
    if (found == known_.end()) {
        return;
    }
    const auto& request = *moved.job->movable();
    if (why.code == errc::too_large) {
        found->second.longest = request.size() - 1;
        return;
    }
    const auto retry = std::chrono::milliseconds{why.retry_ms.value_or(0)};
    if (why.code == errc::busy && retry <= next_slot_retry) {
        return; // only that slot was refused
    }
    found->second.tasks[std::string{task_of(request)}].refused_until =
        now + (why.code == errc::busy ? std::min(retry, max_retry) : refusal_valid_for);
}

// A failure that says that the job has not begun returns it to the queue; anything else is its reply.
void work_sharing::on_outcome(std::uint64_t ticket, std::string_view json, subrequest_failure* why) {
    const auto found = moved_.find(ticket);
    if (found == moved_.end()) {
        return; // withdrawn
    }
    const auto now = node_.time.now();
    const auto moved = std::move(found->second);
    moved_.erase(found);
    const auto& job = moved.job;
    const auto refused = [](const subrequest_failure& by) { // which says so if the result is too large
        return !by.may_have_started || (by.reported.code == errc::too_large && !by.reported.ran);
    };
    if (why != nullptr && refused(*why) && !job->ended()) {
        job->take_back();
        remember_refusal(moved, why->reported, now);
        moved.ended(true);
        balance(now);
        return;
    }
    ++node_.counts.jobs_moved_out;
    if (why == nullptr) {
        measure(moved, now);
        job->done(json);
    } else {
        job->fail(named(std::move(*why), moved.node));
    }
    moved.ended(false);
    balance(now); // there may be another slot
}

void work_sharing::withdraw(std::uint64_t ticket) {
    if (const auto found = moved_.find(ticket); found != moved_.end()) {
        const auto request = found->second.request;
        const auto keep = std::move(found->second); // released after the request
        moved_.erase(found);
        ++node_.counts.jobs_moved_out;
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
        tell(own, now);
    } else if (const auto reserved = granted_.reserved(now); own.free() > reserved) {
        look_at_loads(now);
        grant_slots(own.free() - reserved, own, now);
    }
    arm_timer(own, now);
}

// What a node has said since it last reported its load is newer.
void work_sharing::look_at_loads(time_point now) {
    if (now < look_at_) {
        return;
    }
    look_at_ = now + look_every;
    refresh_neighbours();
    for (const auto* const other : neighbours_) {
        if (other->load.queued != 0) {
            auto& about = known_[other->name];
            const auto* const run = node_.peers.owner(other->name);
            const bool is_newer = run != nullptr && about.heard < run->last_seen;
            about.waiting = is_newer && now >= about.silent_until ? other->load.queued : about.waiting;
        }
    }
}

// The node with the most jobs for which it has no slots yet; null if there is none.
work_sharing::acquaintances::value_type* work_sharing::most_loaded() {
    acquaintances::value_type* most = nullptr;
    for (auto& one : known_) {
        if (one.second.waiting > (most != nullptr ? most->second.waiting : 0)) {
            most = &one;
        }
    }
    return most;
}

// The most loaded ones first, each for the jobs that it may have.
void work_sharing::grant_slots(unsigned slots, const shareable_queue::state& own, time_point now) {
    slots = std::min(slots, slot_grants::max_slots);
    for (acquaintances::value_type* to = nullptr; slots != 0 && (to = most_loaded()) != nullptr;) {
        auto& [node, other] = *to;
        if (find_neighbour(node) == nullptr) {
            other.waiting = 0;
            continue;
        }
        const auto given = std::min<unsigned>(slots, other.waiting);
        slots -= given;
        other.waiting -= given;
        const auto number = open_grant(node, given, now);
        granted_.reserve(node, given, now + slot_grants::valid_for, now); // the reply says which are used
        push({.node = node, .grant = number, .slots = given, .at = now}, object([&](json_writer& w) {
                 write_member(w, "node", std::string_view{node_.name});
                 write_member(w, "free", std::uint64_t{given});
                 write_member(w, "service_us", static_cast<std::uint64_t>(own.service_time.count()));
             }));
    }
}

std::uint64_t work_sharing::open_grant(std::string_view to, unsigned slots, time_point now) {
    const auto number = (std::uint64_t{out_.random()} << 32U | out_.random()) | 1U;
    ++node_.counts.grants_sent;
    return granted_.open(to, number, slots, now);
}

// Nodes that seem to have a free worker first; the others may have become free since they reported their load. From a
// random one on, so that all get to know it.
void work_sharing::tell(const shareable_queue::state& own, time_point now) {
    if (now < tell_at_) {
        return;
    }
    tell_at_ = now + tell_every;
    refresh_neighbours();
    std::erase_if(neighbours_, [&](const known_node* other) {
        const auto found = known_.find(other->name);
        const bool useless = found != known_.end() &&
                             (now < found->second.silent_until ||
                              (now < found->second.unsuitable_until && found->second.unsuitable == own.movable_queued));
        return useless || other->load.workers == 0;
    });
    if (neighbours_.empty()) {
        return;
    }
    std::rotate(neighbours_.begin(),
                neighbours_.begin() + static_cast<std::ptrdiff_t>(draws_.below(neighbours_.size())), neighbours_.end());
    std::stable_partition(neighbours_.begin(), neighbours_.end(), [](const known_node* other) {
        return other->load.queued + other->load.running < other->load.workers;
    });
    const auto body = object([&](json_writer& w) {
        write_member(w, "node", std::string_view{node_.name});
        write_member(w, "waiting", std::uint64_t{own.excess()});
    });
    for (std::size_t i = 0; i < std::min(told_at_once, neighbours_.size()); ++i) {
        push({.node = neighbours_[i]->name, .at = now}, body);
    }
}

void work_sharing::push(const sent_slots& what, const std::string& body) {
    const auto noun = what.node + ":cles/slots";
    const auto adverbs = what.grant != 0 ? "grant=" + protocol::grant_text(what.grant) : std::string{};
    auto then = [weak = std::weak_ptr{alive_}, what](const peer_answer& found) {
        if (const auto self = weak.lock()) {
            (*self)->on_reply(what, found);
        }
    };
    out_.send_own({.verb = verb::push, .noun = noun, .adverbs = adverbs, .body = body},
                  node_.time.now() + slot_grants::valid_for,
                  detail::pending_ptr{new peer_reply{std::move(then), true}});
}

void work_sharing::on_reply(const sent_slots& what, const peer_answer& found) {
    const auto now = node_.time.now();
    auto& other = known_[what.node];
    std::uint32_t taken = 0;
    std::uint32_t waiting = 0;
    if (!found.json.empty()) {
        smooth(other.trip, elapsed(what.at, now));
        json_reader reader{found.json, node_.bounds.depth};
        read_members(reader, [&](std::string_view key) {
            return key == "taken"     ? read_count(reader, taken)
                   : key == "waiting" ? read_count(reader, waiting)
                                      : reader.skip();
        });
    } else if (found.code == errc::deadline) {
        other.trip = slot_grants::valid_for; // at least: a grant would arrive too late
    } else if (found.code == errc::no_task) {
        other.silent_until = now + not_shared_for;
    }
    if (what.grant == 0) {
        return;
    }
    granted_.unreserve(what.node, what.grant, what.slots - std::min(what.slots, taken));
    // Those that it does not give are not for this node, or not worth a transfer: until it reports jobs again.
    other.waiting = taken == 0 ? 0 : waiting;
    other.heard = now;
    balance(now);
}

const known_node* work_sharing::find_neighbour(std::string_view name) const {
    const auto* const others = out_.registry();
    const auto* const found = others != nullptr ? others->find(name) : nullptr;
    return found != nullptr && out_.is_neighbour(*found) ? found : nullptr;
}

// Forgets nodes that are gone.
void work_sharing::refresh_neighbours() {
    neighbours_.clear();
    if (const auto* const others = out_.registry()) {
        for (const auto& [name, other] : others->nodes()) {
            if (out_.is_neighbour(*other)) {
                neighbours_.push_back(other.get());
            }
        }
    }
    std::erase_if(known_, [&](const auto& one) {
        const bool gone = !node_.peers.address_of(one.first);
        if (gone) {
            granted_.forget(one.first);
            std::erase_if(held_, [&](const auto& grant) { return grant.first.first == one.first; });
        }
        return gone;
    });
}

// For what may change without an event here: jobs are to be reported again, a grant expires, others report their loads.
// It is not put off, because this is called often: so it may come when nothing is due.
void work_sharing::arm_timer(const shareable_queue::state& own, time_point now) {
    std::optional<time_point> next;
    if (own.excess() != 0) {
        next = tell_at_;
    } else if (own.free() != 0) {
        next = look_at_;
        if (const auto expiry = granted_.next_expiry(now)) {
            next = std::min(*next, *expiry);
        }
    }
    if (!next) {
        return;
    }
    const auto wanted = std::max(*next, now + std::chrono::milliseconds{1});
    if (!armed() || wanted < due()) {
        node_.deadlines.arm(*this, wanted);
    }
}

} // namespace cles::core
