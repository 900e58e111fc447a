import { Route, Routes } from "react-router";
import { AppFrame } from "./components/AppFrame";
import { CampaignPage } from "./pages/CampaignPage";
import { CampaignsPage } from "./pages/CampaignsPage";
import { FlightPage } from "./pages/FlightPage";
import { FlyPage } from "./pages/FlyPage";
import { JobsPage } from "./pages/JobsPage";
import { NewCampaignPage } from "./pages/NewCampaignPage";
import { NewVehiclePage } from "./pages/NewVehiclePage";
import { NotFoundPage } from "./pages/NotFoundPage";
import { ReproductionsPage } from "./pages/ReproductionsPage";
import { VehiclePage } from "./pages/VehiclePage";
import { VehiclesPage } from "./pages/VehiclesPage";

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
