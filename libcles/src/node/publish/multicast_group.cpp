// SPDX-License-Identifier: BSL-1.0
#include "node/publish/multicast_group.hpp"

#include <cles/json_reader.hpp>

#include "node/membership/membership.hpp"
#include "node/security_protocol.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"

#include <boost/system/errc.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <utility>

namespace cles::core {
namespace {

std::string cannot(const multicast_options& where, const std::string& interface) {
    return "cannot join " + where.group + ":" + std::to_string(where.port) + " on '" + interface + "': ";
}

error cannot_join(const multicast_options& where, const std::string& interface, const boost::system::error_code& why) {
    const auto reason = why == boost::system::errc::address_not_available ? "it has no IPv4 address"
                        : why == boost::system::errc::network_down        ? "it is down"
                                                                          : why.message();
    return {why, cannot(where, interface) + reason};
}

std::vector<network_interface> interfaces_or_throw(environment& by, const multicast_options& where) {
    try {
        return by.interfaces();
    } catch (const boost::system::system_error& e) {
        throw cannot_join(where, where.interface, e.code());
    }
}

void note_failure(node_state& node, const group_source& from, const boost::system::error_code& why) {
    constexpr std::chrono::hours once_in{1};
    const auto source = host_text(from);
    if (node.log && node.logged.take({.kind = "unsent", .source = source, .in = once_in}, node.time.now())) {
        node.post_log(log_level::warning, "cannot send to the multicast group from " + source + ": " + why.message());
    }
}

} // namespace

multicast_group::multicast_group(std::shared_ptr<node_state> host, std::uint32_t seed, std::weak_ptr<void> owner)
    : node_(std::move(host)), owner_(std::move(owner)), feeds_(*node_, *this, seed),
      sources_(node_->peers, node_->bounds.publishers) {}

// -- its interfaces --------------------------------------------------------------------------------------------------

void multicast_group::join(environment& by, const multicast_options& where, bool insecure) {
    check(where);
    environment_ = &by;
    where_ = where;
    insecure_ = insecure;
    chosen_.emplace(where);
    watch(); // before the interfaces are listed, so that no change is missed
    try {
        if (where.interface == "auto") {
            join_automatic();
        } else {
            join_all();
        }
    } catch (const error& e) {
        if (where.required || e.code() == errc::insecure_listen) {
            throw;
        }
        note(log_level::warning, "no multicast: " + e.message());
    }
    compare_when_due();
}

void multicast_group::join(const network_interface& interface) {
    if (!interface.loopback && !insecure_ && !node_->security) {
        throw error(errc::insecure_listen, "multicast on '" + interface.name +
                                               "' can be reached from other hosts, which are not authenticated; "
                                               "set 'insecure' to allow it");
    }
    auto port = environment_->join(interface, where_);
    if (node_->security) {
        port = node_->security->seal(std::move(port));
    }
    const auto source = port->source();
    members_.emplace_back(interface, node_, *this, std::move(port), environment_->random());
    chosen_->on_joined(interface);
    note(log_level::info, node_->name + " has joined " + where_.group + ":" + std::to_string(where_.port) + " on " +
                              interface.name + ", sending from " + to_text(source));
}

// One interface is enough unless all are required.
void multicast_group::join_all() {
    std::vector<error> failures;
    for (const auto& name : interfaces_of(where_)) {
        network_interface found;
        try {
            found = environment_->find_interface(name);
            join(found);
        } catch (const error& refused) {
            chosen_->on_failed(found, false, node_->time.now());
            failures.push_back(refused);
        } catch (const boost::system::system_error& e) {
            if (!found.name.empty()) { // otherwise it can be joined after a change
                chosen_->on_failed(found, true, node_->time.now());
            }
            failures.push_back(cannot_join(where_, name, e.code()));
        }
        if (!failures.empty() && where_.required) {
            throw error{failures.front()};
        }
    }
    if (members_.empty()) {
        throw error{failures.front()};
    }
    for (const auto& e : failures) {
        note(log_level::warning, e.message());
    }
}

// An interface that cannot be joined was not requested by name.
void multicast_group::join_automatic() {
    auto failure = boost::system::error_code{ENETDOWN, boost::system::system_category()};
    const auto steps = chosen_->compare(interfaces_or_throw(*environment_, where_));
    for (const auto& interface : steps.join) {
        try {
            join(interface);
        } catch (const error& refused) {
            if (where_.required) {
                throw;
            }
            failure = refused.code();
            chosen_->on_failed(interface, false, node_->time.now());
            note(log_level::warning, refused.message());
        } catch (const boost::system::system_error& e) {
            failure = e.code();
            chosen_->on_failed(interface, true, node_->time.now());
            note(log_level::warning, cannot_join(where_, interface.name, failure).message());
        }
    }
    if (members_.empty()) {
        throw error(failure, cannot(where_, where_.interface) + "no interface of this host can be used");
    }
    note_left_out(steps.left_out);
}

void multicast_group::note_left_out(const std::vector<std::string>& names) {
    if (where_.interface != "auto" || names.empty() || names == left_out_) {
        left_out_ = names;
        return;
    }
    left_out_ = names;
    std::string list;
    for (const auto& name : names) {
        list += (list.empty() ? "" : ", ") + name;
    }
    note(log_level::warning, "multicast on 'auto' uses " + interfaces() + ", and skips " + list);
}

std::string multicast_group::interfaces() const {
    std::string names;
    for (const auto& each : members_) {
        names += (names.empty() ? "" : ", ") + each.where.name;
    }
    return names;
}

// Later, what is logged may not run user code inside a loop over the interfaces.
void multicast_group::note(log_level level, std::string what) const {
    if (started_) {
        node_->post_log(level, std::move(what));
    } else {
        node_->write_log(level, what);
    }
}

void multicast_group::start() {
    started_ = true;
    for (auto& each : members_) {
        each.session.start();
    }
}

void multicast_group::stop() {
    watch_.reset();
    node_->deadlines.disarm(comparison_);
    chosen_.reset();
    for (auto* feed : feeds_.remove_all()) {
        if (auto waiting = feed->mail().close()) {
            node_->completions.put(completion{
                completion::event_failure{std::move(waiting), errc::stopped, "the service has been stopped"}});
        }
    }
    for (auto& each : members_) {
        each.session.stop();
    }
}

// -- changes of the interfaces ---------------------------------------------------------------------------------------

void multicast_group::watch() {
    try {
        watch_ = environment_->watch_interfaces([this] {
            if (chosen_) {
                chosen_->on_change(node_->time.now());
                compare_when_due();
            }
        });
    } catch (const boost::system::system_error& e) {
        note(log_level::warning, "changes of this host's interfaces will not be noticed: " + e.code().message());
    }
}

void multicast_group::compare_when_due() {
    if (const auto due = chosen_->due()) {
        node_->deadlines.arm(comparison_, *due);
    }
}

// The name of an alias is not among those of the interfaces.
std::vector<network_interface> multicast_group::list_interfaces() const {
    auto all = environment_->interfaces();
    if (where_.interface == "auto") {
        return all;
    }
    for (const auto& name : interfaces_of(where_)) {
        if (std::ranges::find(all, name, &network_interface::name) == all.end()) {
            try {
                all.push_back(environment_->find_interface(name));
            } catch (const boost::system::system_error&) { // there is none now
            }
        }
    }
    return all;
}

void multicast_group::follow_interfaces(time_point now) {
    const auto keep = keep_owner();
    std::vector<network_interface> all;
    try {
        all = list_interfaces();
    } catch (const boost::system::system_error& e) {
        note(log_level::warning, "cannot list the interfaces of this host: " + e.code().message());
        chosen_->on_unlisted(now);
        compare_when_due();
        return;
    }
    const auto steps = chosen_->compare(all);
    for (const auto& each : steps.leave) {
        leave(each);
    }
    if (!chosen_) { // stopped meanwhile
        return;
    }
    bool changed = !steps.leave.empty();
    for (const auto& each : steps.join) {
        changed = join_later(each, now) || changed;
    }
    note_left_out(steps.left_out);
    if (changed && listener_ != nullptr) {
        listener_->on_interfaces_changed(now);
    }
    compare_when_due();
}

// What others announce there is asked for, as at the start. In a secured fleet, they do not take questions from a
// source that this node has not announced yet: they are asked after that.
bool multicast_group::join_later(const network_interface& interface, time_point now) {
    try {
        join(interface);
    } catch (const error& refused) {
        if (chosen_->on_failed(interface, false, now)) {
            note(log_level::warning, refused.message());
        }
        return false;
    } catch (const boost::system::system_error& e) {
        if (chosen_->on_failed(interface, true, now)) {
            note(log_level::warning, cannot_join(where_, interface.name, e.code()).message());
        }
        return false;
    }
    auto& port = *ports_.back();
    members_.back().session.start();
    if (!node_->security) {
        ask(port);
    }
    return true;
}

void multicast_group::ask(group_port& by) {
    if (listener_ != nullptr) {
        send(by, "BIND all:cles\n");
    }
    feeds_.bind_on(by);
}

void multicast_group::ask_again() {
    for (auto* each : ports_) {
        ask(*each);
    }
}

void multicast_group::leave(const network_interface& interface) {
    const auto at = std::ranges::find_if(members_, [&](const member_interface& each) {
        return each.where.index == interface.index && each.where.address == interface.address;
    });
    if (at == members_.end()) {
        return;
    }
    std::list<member_interface> left; // removed first: publishers that waited for its subscribers go on
    left.splice(left.begin(), members_, at);
    note(log_level::info, node_->name + " has left " + where_.group + ":" + std::to_string(where_.port) + " on " +
                              interface.name + ", which does not have " + host_text({.address = interface.address}) +
                              " any more");
}

// -- what is sent ----------------------------------------------------------------------------------------------------

bool send_to(group_port& by, node_state& node, std::string_view lines) {
    if (lines.empty()) {
        return true;
    }
    const auto taken = by.send(lines);
    auto& counts = node.counts;
    counts.group_sent += taken.count;
    if (taken.failed != 0) { // some of them may have been pending, and were counted as sent
        counts.group_sent -= taken.failed;
        counts.group_failed += taken.failed;
        note_failure(node, by.source(), taken.why);
    }
    const auto left = lines.substr(taken.bytes);
    counts.group_unsent += static_cast<std::uint64_t>(std::ranges::count(left, '\n'));
    return left.empty();
}

bool multicast_group::send(group_port& by, std::string_view line) {
    if (line.size() > protocol::datagram_bytes) {
        ++node_->counts.group_unsent;
        return false;
    }
    return send_to(by, *node_, line);
}

bool multicast_group::send(std::string_view line) {
    bool sent = false;
    for (auto* each : ports_) {
        sent = send(*each, line) || sent;
    }
    return sent;
}

// -- what arrives ----------------------------------------------------------------------------------------------------

bool multicast_group::is_own(const group_source& from) const noexcept {
    return std::ranges::any_of(ports_, [&](const auto* port) { return port->source() == from; });
}

bool multicast_group::is_of_this_host(const group_source& from) const noexcept {
    return from.is_loopback() ||
           std::ranges::any_of(ports_, [&](const auto* port) { return port->source().address == from.address; });
}

void multicast_group::solicited(bool by_name, time_point now) {
    if (listener_ != nullptr) {
        listener_->on_solicitation(by_name, now);
    }
}

// In a secured fleet, a member publishes under its own name, with the epoch that it has confirmed.
bool multicast_group::is_by_its_publisher(const group_datagram& datagram) const noexcept {
    const auto& update = *datagram.request;
    return !node_->security || (datagram.member == update.noun.target && datagram.epoch == update.epoch);
}

bool multicast_group::is_copy(const group_datagram& datagram) const {
    return node_->security && (!datagram.request->is_update() || datagram.request->noun.path != "cles") &&
           node_->peers.is_elsewhere(datagram.member, datagram.epoch, datagram.from);
}

bool multicast_group::take(const group_datagram& datagram, time_point now) {
    using verdict = publisher_sources::verdict;
    const auto& from = datagram.from;
    const auto& update = *datagram.request;
    const auto& noun = update.noun;
    if (!is_by_its_publisher(datagram)) {
        return false;
    }
    if (node_->secured && noun.path == load_path) {
        return datagram.accept() && node_->secured->on_load_report(from, update, now);
    }
    if (noun.task == "cles") {
        return take_announcement(datagram, now);
    }
    auto& counts = node_->counts;
    if (protocol::begins_with_error(update.body) || !feeds_.wants(update) || sources_.is_foreign(from, now) ||
        !permits(*node_, {.requester = node_->name}, noun.target, verb::bind, noun)) {
        ++counts.updates_dropped;
        return true;
    }
    const auto check = node_->secured ? node_->secured->check(update, false) : update_check::unsigned_one;
    if (check == update_check::refused) {
        ++counts.updates_unsigned;
        return true;
    }
    const auto found = sources_.look(noun.target, from, now);
    if (found == verdict::another) {
        feeds_.forget(noun.target);
    }
    if (found != verdict::refused && datagram.accept(check == update_check::signed_one) && feeds_.take(update)) {
        ++counts.updates_received;
    } else if (found == verdict::one_of_several) {
        ++counts.group_repeated;
    } else {
        ++counts.updates_dropped;
        if (const auto why = node_->log ? why_unreadable(update.body) : std::string{}; !why.empty()) {
            node_->log_drop(host_text(from), "an update", why, true);
        }
    }
    return true;
}

// Other hosts have the same addresses on loopback.
bool multicast_group::is_from_stated_source(const group_datagram& datagram, const announcement& said) const {
    const auto& from = datagram.from;
    const auto* const run = from.is_loopback() ? node_->peers.announced(datagram.member) : nullptr;
    const bool is_of_another_host = run != nullptr && run->epoch == datagram.epoch && !is_of_this_host(run->from);
    return !is_of_another_host && std::ranges::find(said.sources, from) != said.sources.end();
}

// In a secured fleet, announcements are signed, since others pass them on. Strangers can repeat them from other
// sources, so the source is checked first, and the signature, which takes longer, after it.
bool multicast_group::take_announcement(const group_datagram& datagram, time_point now) {
    using repetition = datagram_admission::repetition;
    const auto& update = *datagram.request;
    auto& counts = node_->counts;
    if (!update.noun.parameters.empty() || !is_valid_json(update.body, node_->bounds.depth)) {
        return false;
    }
    heard_announcement heard{.said = {}, .epoch = *update.epoch, .seq = *update.seq, .from = datagram.from};
    std::string why;
    if (!read_announcement(update, heard.said, why)) {
        ++counts.announcements_dropped;
        node_->log_drop(host_text(heard.from), "an announcement", why, false);
        return true;
    }
    if (const auto& security = node_->security) {
        if (!is_from_stated_source(datagram, heard.said)) {
            ++counts.group_copied;
            return true;
        }
        if (!security->is_signed(datagram.member, update.noun.path, heard.seq, protocol::epoch_text(heard.epoch),
                                 update.body, update.sig)) {
            return false;
        }
        heard.said.original = std::make_shared<signed_announcement>(
            signed_announcement{std::string{update.body}, std::string{update.sig}});
    }
    const auto found = datagram.accept_announcement(heard.seq);
    if (found == repetition::refused) {
        return false;
    }
    heard.again = found == repetition::again;
    if (listener_ != nullptr) {
        listener_->on_announcement(std::move(heard), now);
    }
    return true;
}

publisher_sources::verdict publisher_sources::look(std::string_view node, const group_source& from, time_point now) {
    if (const auto* const run = others_.announced(node)) {
        return !run->sends_from(from)               ? verdict::refused
               : run->announced.sources.size() <= 1 ? verdict::taken
                                                    : verdict::one_of_several;
    }
    if (const auto found = source_bindings_.find(node); found != source_bindings_.end()) {
        const bool same = found->second.to == from;
        if (!same && now - found->second.heard < silent_after) {
            return verdict::refused;
        }
        found->second = {from, now};
        return same ? verdict::taken : verdict::another;
    }
    if (source_bindings_.size() >= max_entries_ && !source_bindings_.empty()) {
        source_bindings_.erase(
            std::min_element(source_bindings_.begin(), source_bindings_.end(),
                             [](const auto& a, const auto& b) { return a.second.heard < b.second.heard; }));
    }
    source_bindings_.emplace(std::string{node}, source_binding{from, now});
    return verdict::taken;
}

void publisher_sources::note_foreign(const group_source& from, time_point until) {
    if (foreign_.size() >= max_entries_ && !foreign_.contains(from)) {
        foreign_.erase(std::min_element(foreign_.begin(), foreign_.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; }));
    }
    if (max_entries_ != 0) {
        foreign_.insert_or_assign(from, until);
    }
}

} // namespace cles::core
