import { type ComponentType, lazy, useEffect } from "react";
import { Redirect, Route, Switch } from "wouter";
import { ApiError, PAGE_MISSING } from "./api/problems";
import { loadPlotly } from "./charts/plotly";
import { CampaignPage } from "./features/campaign/CampaignPage";
import { CampaignListPage } from "./features/campaign-list/CampaignListPage";
import { AppFrame } from "./frame/AppFrame";
import type * as PageModule from "./pages";
import { NotFoundPage } from "./ui/NotFound";

const ComparePage = lazyPage("ComparePage");
const FailureShapesPage = lazyPage("FailureShapesPage");
const LogAnalysisPage = lazyPage("LogAnalysisPage");
const LogPage = lazyPage("LogPage");
const LoggedVehiclePage = lazyPage("LoggedVehiclePage");
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
    <AppFrame>
      <Switch>
        <Route path="/" component={CampaignListPage} />
        <Route path="/new" component={NewCampaignPage} />
        <Route path="/campaigns/:campaignId" component={CampaignPage} />
        <Route path="/campaigns/:campaignId/flights/:trialId" component={FlightPage} />
        <Route path="/compare" component={ComparePage} />
        <Route path="/fly/:trialId" component={FlyPage} />
        <Route path="/vehicles" component={VehiclesPage} />
        <Route path="/vehicles/new" component={NewVehiclePage} />
        <Route path="/vehicles/:vehicleId" component={VehiclePage} />
        <Route path="/vehicles/:vehicleId/edit" component={EditVehiclePage} />
        <Route path="/reproductions" component={ReproductionsPage} />
        <Route path="/log-analysis" component={LogAnalysisPage} />
        <Route path="/log-analysis/:logId" component={LogPage} />
        <Route path="/log-analysis/vehicles/:vehicleId" component={LoggedVehiclePage} />
        <Route path="/failure-shapes" component={FailureShapesPage} />
        <Route path="/jobs" component={JobsPage} />
        <Route path="/settings" component={SettingsPage} />
        <Route path="/controller/*?">
          <Redirect to="/log-analysis" replace />
        </Route>
        <Route component={NotFoundPage} />
      </Switch>
    </AppFrame>
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
