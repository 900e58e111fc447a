import { Route, Routes } from "react-router";
import { AppFrame } from "./components/AppFrame";
import { later } from "./components/later";
import { CampaignPage } from "./pages/CampaignPage";
import { CampaignsPage } from "./pages/CampaignsPage";
import { NotFoundPage } from "./pages/NotFoundPage";

const ComparePage = later("ComparePage");
const ControllerPage = later("ControllerPage");
const FlightPage = later("FlightPage");
const FlyPage = later("FlyPage");
const JobsPage = later("JobsPage");
const NewCampaignPage = later("NewCampaignPage");
const NewVehiclePage = later("NewVehiclePage");
const ReproductionsPage = later("ReproductionsPage");
const SettingsPage = later("SettingsPage");
const VehiclePage = later("VehiclePage");
const VehiclesPage = later("VehiclesPage");

export function App() {
  return (
    <Routes>
      <Route element={<AppFrame />}>
        <Route index element={<CampaignsPage />} />
        <Route path="new" element={<NewCampaignPage />} />
        <Route path="campaigns/:campaignId" element={<CampaignPage />} />
        <Route path="campaigns/:campaignId/flights/:trialId" element={<FlightPage />} />
        <Route path="compare" element={<ComparePage />} />
        <Route path="fly/:trialId" element={<FlyPage />} />
        <Route path="vehicles" element={<VehiclesPage />} />
        <Route path="vehicles/new" element={<NewVehiclePage />} />
        <Route path="vehicles/:vehicleId" element={<VehiclePage />} />
        <Route path="reproductions" element={<ReproductionsPage />} />
        <Route path="controller/:checkId?" element={<ControllerPage />} />
        <Route path="jobs" element={<JobsPage />} />
        <Route path="settings" element={<SettingsPage />} />
        <Route path="*" element={<NotFoundPage />} />
      </Route>
    </Routes>
  );
}
