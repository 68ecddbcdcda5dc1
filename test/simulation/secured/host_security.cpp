// SPDX-License-Identifier: BSL-1.0
#include "simulation/secured/host_security.hpp"

#include "node/secured/secured_protocol.hpp"
#include "protocol/request_line.hpp"
#include "simulation/network/group_port.hpp"
#include "tls/sealed_udp.hpp"

#include <functional>
#include <utility>

namespace cles::simulation {
namespace {

/// The library's admission.
class link_gate final : public stream_gate {
  public:
    /// \param stranger a planted fault: those who are refused are admitted under that name
    link_gate(std::shared_ptr<security::admission_terms> terms, std::string_view expected, planted fault,
              std::string stranger)
        : terms_(std::move(terms)), admission_(terms_, std::string{expected}), fault_(fault),
          stranger_(std::move(stranger)) {}

    void begin(const link_key& peer, std::string& out) override { admission_.begin(peer, out); }
    verdict on_line(std::string_view line, std::string& out) override {
        switch (admission_.on_line(line, out)) {
        case security::link_admission::verdict::pending: return verdict::pending;
        case security::link_admission::verdict::admitted: stranger_.clear(); return verdict::admitted;
        case security::link_admission::verdict::refused: break;
        }
        return stranger_.empty() ? verdict::refused : verdict::admitted;
    }
    [[nodiscard]] std::size_t max_line() const override { return admission_.max_line(); }
    [[nodiscard]] const std::string& name() const override { return stranger_.empty() ? admission_.name() : stranger_; }
    [[nodiscard]] std::string_view epoch() const override { return admission_.epoch(); }
    void watch(std::function<void()> removed) override {
        observation_ = terms_->fleet->observe([this, removed = std::move(removed)](const security::roster&) {
            if (stranger_.empty() && fault_ != planted::removed_served && !admission_.is_in_force()) {
                removed();
            }
        });
    }

  private:
    std::shared_ptr<security::admission_terms> terms_;
    security::link_admission admission_;
    planted fault_;
    std::string stranger_;
    std::shared_ptr<void> observation_;
};

/// Reports lines, since the port below carries only what is sealed.
class reporting_port final : public core::group_port, private core::group_listener {
  public:
    using permission = std::function<bool(const core::group_datagram& bind)>;

    reporting_port(std::shared_ptr<core::group_port> sealed, std::shared_ptr<simulation::group_port> below,
                   permission permits, planted fault)
        : sealed_(std::move(sealed)), below_(std::move(below)), permits_(std::move(permits)), fault_(fault) {}

    void start(core::group_listener& owner) override {
        owner_ = &owner;
        sealed_->start(*this);
    }
    core::datagrams_done send(core::datagram_list all) override {
        const auto done = sealed_->send(all);
        for (auto count = done.count; count != 0; --count, all.drop_first()) {
            below_->report_sent(all.first());
        }
        return done;
    }
    void send_to(const core::group_source& to, std::string_view datagram) override { sealed_->send_to(to, datagram); }
    void receive_own() override { sealed_->receive_own(); }
    [[nodiscard]] std::size_t unsent() const noexcept override { return sealed_->unsent(); }
    void close() override { sealed_->close(); }
    [[nodiscard]] const core::group_source& source() const noexcept override { return sealed_->source(); }

  private:
    /// Reports a line that counts because of its counter.
    class reporting_admission final : public core::datagram_admission {
      public:
        reporting_admission(const core::group_datagram& datagram, reporting_port& by) noexcept
            : datagram_(datagram), by_(by) {}
        bool accept(bool is_signed) override {
            const bool counts = datagram_.accept(is_signed) || by_.fault_ == planted::group_replay_taken;
            if (counts && !is_signed) {
                by_.below_->report_accepted(datagram_.member, datagram_.text);
                if (is_bind(datagram_) && by_.permits_(datagram_)) {
                    by_.below_->report_received(datagram_.from, datagram_.text);
                }
            }
            return counts;
        }
        repetition accept_announcement(std::uint64_t seq) override { return datagram_.accept_announcement(seq); }

      private:
        const core::group_datagram& datagram_;
        reporting_port& by_;
    };

    [[nodiscard]] static bool is_bind(const core::group_datagram& d) {
        return d.request != nullptr && d.request->verb == verb::bind;
    }

    void on_datagram(const core::group_datagram& datagram) override {
        if (!is_bind(datagram)) { // which counts if it is accepted
            below_->report_received(datagram.from, datagram.text);
        }
        reporting_admission admission{datagram, *this};
        auto passed = datagram;
        passed.admission = &admission;
        owner_->on_datagram(passed);
    }
    void on_writable() override { owner_->on_writable(); }

    std::shared_ptr<core::group_port> sealed_;
    std::shared_ptr<simulation::group_port> below_;
    permission permits_;
    planted fault_;
    core::group_listener* owner_ = nullptr;
};

} // namespace

host_security::host_security(const std::string& directory, planted fault)
    : secured_node(directory), fault_(fault), terms_(std::make_shared<security::admission_terms>()) {
    terms_->fleet = members();
}

void host_security::begin(std::string_view name, std::uint32_t epoch, const core::clock& time,
                          core::security_observer& observer) {
    terms_->epoch = protocol::epoch_text(epoch);
    secured_node::begin(name, epoch, time, observer);
}

bool host_security::is_member(std::string_view name) const {
    return secured_node::is_member(name) || fault_ == planted::removed_served;
}

bool host_security::allows(const core::request_origin& by, std::string_view provider, verb how,
                           const protocol::noun_view& noun) const {
    return secured_node::allows(by, provider, how, noun) || fault_ == planted::rights_ignored ||
           (fault_ == planted::removed_served && !secured_node::is_member(by.requester));
}

std::shared_ptr<core::group_port> host_security::seal(std::shared_ptr<core::group_port> port) {
    auto below = std::dynamic_pointer_cast<simulation::group_port>(port);
    return std::make_shared<reporting_port>(
        secured_node::seal(std::move(port)), std::move(below),
        [this](const core::group_datagram& bind) {
            return secured_node::allows({.requester = bind.member}, name(), verb::bind, bind.request->noun);
        },
        fault_);
}

std::unique_ptr<stream_gate> host_security::make_gate(std::string_view expected) {
    const bool admits = fault_ == planted::stranger_admitted && expected.empty();
    return std::make_unique<link_gate>(terms_, expected, fault_, admits ? fleet().name() : std::string{});
}

std::unique_ptr<transport::datagram_codec> host_security::make_codec() {
    return std::make_unique<tls::udp_codec>(members(), datagrams());
}

simulated_security::protocol_maker host_security::maker_of_protocol() const { return &core::make_secured_protocol; }

std::uint32_t host_security::number_of(std::string_view name) const {
    const auto* const found = fleet().in_force().find(name);
    return found == nullptr ? 0 : found->number;
}

} // namespace cles::simulation
