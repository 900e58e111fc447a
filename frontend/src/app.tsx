import { lazy } from "react";
import { Route, Routes } from "react-router";
import { AppFrame } from "./components/AppFrame";
import { CampaignPage } from "./pages/CampaignPage";
import { CampaignsPage } from "./pages/CampaignsPage";
import { NotFoundPage } from "./pages/NotFoundPage";

// What is not looked at first is fetched when it is.
const FlightPage = lazy(async () => ({ default: (await import("./pages/FlightPage")).FlightPage }));
const FlyPage = lazy(async () => ({ default: (await import("./pages/FlyPage")).FlyPage }));
const JobsPage = lazy(async () => ({ default: (await import("./pages/JobsPage")).JobsPage }));
const NewCampaignPage = lazy(async () => ({ default: (await import("./pages/NewCampaignPage")).NewCampaignPage }));
const NewVehiclePage = lazy(async () => ({ default: (await import("./pages/NewVehiclePage")).NewVehiclePage }));
const ReproductionsPage = lazy(async () => ({
  default: (await import("./pages/ReproductionsPage")).ReproductionsPage,
}));
const VehiclePage = lazy(async () => ({ default: (await import("./pages/VehiclePage")).VehiclePage }));
const VehiclesPage = lazy(async () => ({ default: (await import("./pages/VehiclesPage")).VehiclesPage }));

export function App() {
  return (
    <Routes>
      <Route element={<AppFrame />}>
        <Route index element={<CampaignsPage />} />
        <Route path="new" element={<NewCampaignPage />} />
        <Route path="campaigns/:campaignId" element={<CampaignPage />} />
        <Route path="campaigns/:campaignId/flights/:trialId" element={<FlightPage />} />
        <Route path="fly/:trialId" element={<FlyPage />} />
        <Route path="vehicles" element={<VehiclesPage />} />
        <Route path="vehicles/new" element={<NewVehiclePage />} />
        <Route path="vehicles/:vehicleId" element={<VehiclePage />} />
        <Route path="reproductions" element={<ReproductionsPage />} />
        <Route path="jobs" element={<JobsPage />} />
        <Route path="*" element={<NotFoundPage />} />
      </Route>
    </Routes>
  );
}
