import { useEffect } from "react";
import { Route, Routes } from "react-router";
import { CampaignPage } from "./features/campaign/CampaignPage";
import { CampaignsPage } from "./features/campaigns/CampaignsPage";
import { AppFrame } from "./frame/AppFrame";
import { fetchEveryPage, lazyPage } from "./lazyPage";
import { NotFoundPage } from "./ui/NotFoundPage";

const ComparePage = lazyPage("ComparePage");
const ControllerPage = lazyPage("ControllerPage");
const FlightPage = lazyPage("FlightPage");
const FlyPage = lazyPage("FlyPage");
const JobsPage = lazyPage("JobsPage");
const NewCampaignPage = lazyPage("NewCampaignPage");
const NewVehiclePage = lazyPage("NewVehiclePage");
const ReproductionsPage = lazyPage("ReproductionsPage");
const SettingsPage = lazyPage("SettingsPage");
const VehiclePage = lazyPage("VehiclePage");
const VehiclesPage = lazyPage("VehiclesPage");

export function App() {
  useEffect(fetchEveryPage, []);
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
