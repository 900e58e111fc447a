import { type ComponentType, lazy, useEffect } from "react";
import { Navigate, Route, Routes } from "react-router";
import { ApiError, PAGE_MISSING } from "./api/problems";
import { loadPlotly } from "./charts/plotly";
import { CampaignPage } from "./features/campaign/CampaignPage";
import { CampaignListPage } from "./features/campaign-list/CampaignListPage";
import { AppFrame } from "./frame/AppFrame";
import type * as PageModule from "./pages";
import { NotFoundPage } from "./ui/NotFound";

const ComparePage = lazyPage("ComparePage");
const LogAnalysisPage = lazyPage("LogAnalysisPage");
const EditVehiclePage = lazyPage("EditVehiclePage");
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
        <Route index element={<CampaignListPage />} />
        <Route path="new" element={<NewCampaignPage />} />
        <Route path="campaigns/:campaignId" element={<CampaignPage />} />
        <Route path="campaigns/:campaignId/flights/:trialId" element={<FlightPage />} />
        <Route path="compare" element={<ComparePage />} />
        <Route path="fly/:trialId" element={<FlyPage />} />
        <Route path="vehicles" element={<VehiclesPage />} />
        <Route path="vehicles/new" element={<NewVehiclePage />} />
        <Route path="vehicles/:vehicleId" element={<VehiclePage />} />
        <Route path="vehicles/:vehicleId/edit" element={<EditVehiclePage />} />
        <Route path="reproductions" element={<ReproductionsPage />} />
        <Route path="controller/*" element={<Navigate to="/log-analysis" replace />} />
        <Route path="log-analysis" element={<LogAnalysisPage />} />
        <Route path="jobs" element={<JobsPage />} />
        <Route path="settings" element={<SettingsPage />} />
        <Route path="*" element={<NotFoundPage />} />
      </Route>
    </Routes>
  );
}

type Pages = typeof PageModule;

async function fetchPages(): Promise<Pages> {
  try {
    return await import("./pages");
  } catch {
    throw new ApiError(PAGE_MISSING);
  }
}

/** A page whose code is loaded on demand. */
function lazyPage(name: keyof Pages): ComponentType {
  return lazy(async () => ({ default: (await fetchPages())[name] }));
}

const SOON_MS = 2500;

/** Preload the code of all pages and charts, so that they still open when the server or the Wi-Fi is lost. */
function fetchEveryPage(): void {
  // A page whose preload failed loads its code again when it is opened, and reports the error.
  setTimeout(() => void Promise.allSettled([fetchPages(), loadPlotly(), loadPlotly("contours")]), SOON_MS);
}
