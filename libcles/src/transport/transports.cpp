// SPDX-License-Identifier: BSL-1.0
#include "transport/transports.hpp"

#include <cles/link.hpp>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace cles {
namespace {

using table = std::map<std::string, std::unique_ptr<link_transport>, std::less<>>;

table& transports() {
    // Services in static objects use it until they are destroyed.
    static auto& instance = *[] {
        auto t = std::make_unique<table>();
        t->emplace("tcp", transport::make_tcp());
        t->emplace("udp", transport::make_udp());
        t->emplace("unix", transport::make_unix());
        t->emplace("inproc", transport::make_inproc());
        return t.release();
    }();
    return instance;
}

class acceptor_handle final : public acceptor {
  public:
    explicit acceptor_handle(std::shared_ptr<acceptor> shared) : shared_(std::move(shared)) {}
    ~acceptor_handle() override { shared_->close(); }

    [[nodiscard]] url local() const override { return shared_->local(); }
    void start(std::function<void(link_ptr)> on_link) override { shared_->start(std::move(on_link)); }
    void accept_waiting() override { shared_->accept_waiting(); }
    void close() override { shared_->close(); }

  private:
    std::shared_ptr<acceptor> shared_;
};

} // namespace

std::unique_ptr<acceptor> transport::handle_of(std::shared_ptr<acceptor> shared) {
    return std::make_unique<acceptor_handle>(std::move(shared));
}

link_transport* find_transport(std::string_view scheme) {
    const auto found = transports().find(scheme);
    return found == transports().end() ? nullptr : found->second.get();
}

std::unique_ptr<link_transport> register_transport(std::string_view scheme, std::unique_ptr<link_transport> carrier) {
    return std::exchange(transports()[std::string{scheme}], std::move(carrier));
}

} // namespace cles
